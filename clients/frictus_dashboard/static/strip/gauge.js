/** One quantity as a number over a small bar, as `gaugeStateOf` says it. */

import { element, say } from "../elements/element.js";

export class Gauge {
  /** @param {Element} root @param {{name: string, unit: string}} what */
  constructor(root, { name, unit }) {
    this.root = root;
    this.number = element("b", { class: "number" });
    this.words = element("p", { class: "words" });
    this.zone = element("div", { class: "zone" });
    this.mark = element("div", { class: "mark" });
    root.append(
      element("p", { class: "reading", "data-unit": ` ${unit}` }, `${name} `, this.number, ` ${unit}`),
      element("div", { class: "bar", "aria-hidden": "true" }, this.zone, this.mark),
      this.words,
    );
  }

  /** @param {object} state of `gaugeStateOf` */
  show({ figure, verdict, words, mark, zone }) {
    this.root.dataset.verdict = verdict;
    say(this.number, figure);
    say(this.words, words);
    this.mark.hidden = mark === null;
    this.zone.hidden = zone === null;
    if (mark !== null) place(this.mark, "--at", mark);
    if (zone === null) return;
    place(this.zone, "--from", zone[0]);
    place(this.zone, "--to", zone[1]);
  }
}

function place(part, property, share) {
  part.style.setProperty(property, `${(100 * share).toFixed(2)}%`);
}
