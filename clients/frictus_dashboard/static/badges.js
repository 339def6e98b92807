/** What a viewer must know of the data: badges from status, scene, model and block flags. */

import { followed } from "./adaptation.js";
import { remark } from "./compensation.js";
import { FLAGS } from "./frames.js";
import { element } from "./element.js";

/** How long a flag of one block stays on screen. */
const HOLD_MS = 1_500;
const MEANINGS = {
  simulated: "Simulated: a model plays device and finger",
  placeholder: "Placeholder calibration: nobody measured this finger",
  substitute: "Substitute sensor: no touch sensor",
  extrapolated: "Extrapolated: speed beyond what was measured",
  scaled: "Scaled: the scene asks for more than the drive can give",
  stale: "Stale: touch sensor or streamed texture late",
  saturated: "Saturated: a sensor at the end of its range",
  clipped: "Clipped: the drive at its limit",
};

export class Badges {
  constructor(root) {
    this.root = root;
    this.flaggedMs = {};
    this.shown = "";
  }

  /** Note the flags of a block. */
  note(flags, nowMs) {
    for (const name of Object.keys(MEANINGS)) {
      if (flags & FLAGS[name]) this.flaggedMs[name] = nowMs;
    }
  }

  /** @param {{status: object|null, scene: object|null, finger: object|null}} rig */
  show({ status, scene, finger }, nowMs) {
    const said = {
      simulated: status?.simulated,
      placeholder: status?.model_placeholder,
      substitute: status?.finger_source === "pointer",
      extrapolated: finger?.extrapolated && finger.in_contact,
      scaled: scene?.applied.scaled,
      stale: finger?.stale || status?.stream_stale,
    };
    const recent = (name) => nowMs - (this.flaggedMs[name] ?? -Infinity) < HOLD_MS;
    const names = Object.keys(MEANINGS).filter((name) => said[name] || recent(name));
    const badges = names.map((name) => [name, MEANINGS[name]]);
    const mode = remark(status?.compensation);
    if (mode !== "") badges.unshift(["compensation", mode]);
    const follows = followed(status);
    if (follows !== "") badges.unshift(["adaptation", follows]);
    if (badges.join() === this.shown) return;
    this.shown = badges.join();
    this.root.replaceChildren(...badges.map(badge));
  }
}

function badge([name, meaning]) {
  const [word, why] = meaning.split(": ");
  return element("li", { class: "badge", "data-badge": name }, element("b", {}, word), ` ${why}`);
}
