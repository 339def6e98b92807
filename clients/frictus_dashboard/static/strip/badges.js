/** What a viewer must know of the data: badges from status, scene, finger and block flags. */

import { followed } from "../rig/adaptation.js";
import { remark } from "../rig/compensation.js";
import { FLAGS } from "../connection/frames.js";

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

/** The flags of blocks, held for as long as people need to read them. */
export class HeldFlags {
  constructor() {
    this.flaggedMs = {};
  }

  /** Note the flags of a block. */
  note(flags, nowMs) {
    for (const name of Object.keys(MEANINGS)) {
      if (flags & FLAGS[name]) this.flaggedMs[name] = nowMs;
    }
  }

  /** Names of the flags that were raised lately. */
  recent(nowMs) {
    return Object.keys(this.flaggedMs).filter((name) => nowMs - this.flaggedMs[name] < HOLD_MS);
  }
}

/**
 * @param {{status: object|null, scene: object|null, finger: object|null}} rig
 * @param {string[]} flags raised lately
 * @returns {{name: string, word: string, why: string}[]} what matters most comes first
 */
export function badgesOf({ status = null, scene = null, finger = null }, flags = []) {
  const said = {
    simulated: status?.simulated,
    placeholder: status?.model_placeholder,
    substitute: status?.finger_source === "pointer",
    extrapolated: finger?.extrapolated && finger.in_contact,
    scaled: scene?.applied.scaled,
    stale: finger?.stale || status?.stream_stale,
  };
  const names = Object.keys(MEANINGS).filter((name) => said[name] || flags.includes(name));
  const badges = [
    ["adaptation", followed(status)],
    ["compensation", remark(status?.compensation)],
    ...names.map((name) => [name, MEANINGS[name]]),
  ];
  return badges.filter(([, meaning]) => meaning !== "").map(([name, meaning]) => {
    const [word, why] = meaning.split(": ");
    return { name, word, why };
  });
}
