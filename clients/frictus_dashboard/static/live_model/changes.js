/** The changes of the model, newest first: when, from what to what, why. */

import { element } from "../elements/element.js";
import { clock } from "../elements/figures.js";

const VALUES = [
  ["gain", "gain_n", "N", 3],
  ["cutoff at 20 mm/s", "cutoff_20_hz", "Hz", 0],
  ["at 100 mm/s", "cutoff_100_hz", "Hz", 0],
];

export class Changes {
  constructor() {
    this.list = element("ol", { class: "changes", tabindex: "0", role: "list" });
    this.list.setAttribute("aria-label", "Changes of the model, newest first");
    this.root = element("div", { class: "log" }, this.list);
    this.shown = null;
  }

  /** @param {object} state of `viewStateOf` */
  show({ changes = [], estimate }) {
    const nowNs = estimate?.utc_ns;
    const times = changes.map(({ utc_ns: ns }) => clock(ns, nowNs));
    const shown = JSON.stringify([changes, times]);
    if (shown === this.shown) return;
    this.shown = shown;
    this.root.hidden = changes.length === 0;
    this.list.replaceChildren(...changes.map((one, i) => change(one, times[i])));
  }
}

function change({ before, after, reason }, time) {
  const told = VALUES.map(([title, name, unit, digits]) => {
    return `${title} ${before[name].toFixed(digits)} → ${after[name].toFixed(digits)} ${unit}`;
  });
  return element(
    "li",
    {},
    element("b", {}, time),
    ` ${told.join(", ")}`,
    element("span", { class: "quiet" }, ` ${reason}`),
  );
}
