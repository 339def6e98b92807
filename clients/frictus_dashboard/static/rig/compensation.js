/** The compensation mode: a switch for whoever holds the rig. What is pressed is in force. */

import { outcomeUnknown, request } from "../connection/api.js";
import { at, say } from "../elements/element.js";
import { keptOut } from "./holder.js";

/** The fixed speed that the switch offers, or the nearest that the model holds for. */
const FIXED_MM_S = 60;

export class Compensation {
  constructor() {
    this.rig = null;
    this.mode = { mode: "model", speed_mm_s: null };
    this.fixedMmS = FIXED_MM_S;
    /** What was chosen last, of which rig, and is not sent yet: the newest choice wins. */
    this.wanted = null;
    this.sending = false;
    this.buttons = [...at("compensation-modes").querySelectorAll("button")];
    for (const button of this.buttons) {
      button.addEventListener("click", () => this.#choose(button.value));
    }
  }

  /**
   * @param {string} rig
   * @param {object} status the rig's newest
   * @param {boolean} may whether this page may change what is rendered where nobody keeps it out
   * @param {string} client name of this page to the rigs
   * @param {object|null} model the active one
   */
  show(rig, status, may, client, model) {
    const { mode, speed_mm_s } = status.compensation;
    const changed = mode !== this.mode.mode || speed_mm_s !== this.mode.speed_mm_s;
    if (changed || rig !== this.rig) say(at("compensation-outcome"), "");
    this.rig = rig;
    this.mode = status.compensation;
    const [slowest, fastest] = model?.validity.speed_mm_s ?? [FIXED_MM_S, FIXED_MM_S];
    this.fixedMmS = speed_mm_s ?? Math.min(Math.max(FIXED_MM_S, slowest), fastest);
    const armed = status.state === "armed";
    at("compensation").hidden = !(may && armed && keptOut(rig, status, client) === "");
    for (const button of this.buttons) {
      button.setAttribute("aria-pressed", String(button.value === mode));
      if (button.value === "fixed") say(button, modeTitle({ mode: "fixed", speed_mm_s: this.fixedMmS }));
    }
  }

  /** Ask for a mode; of clicks that come while an answer is awaited the last one counts. */
  async #choose(mode) {
    const chosen = mode === "fixed" ? { mode, speed_mm_s: this.fixedMmS } : { mode };
    this.wanted = { rig: this.rig, json: chosen };
    if (this.sending) return;
    this.sending = true;
    while (this.wanted !== null) {
      const { rig, json } = this.wanted;
      this.wanted = null;
      await this.#send(rig, json);
    }
    this.sending = false;
  }

  async #send(rig, json) {
    const told = await switchTo(rig, json);
    if (rig === this.rig) say(at("compensation-outcome"), told);
  }
}

/** Ask a rig for a mode; what went wrong, in words. @returns {Promise<string>} */
export async function switchTo(rig, json) {
  try {
    await request("PUT", `/rigs/${encodeURIComponent(rig)}/compensation`, { json });
    return "";
  } catch (error) {
    const unknown = "Unknown whether it is switched; what is pressed is in force";
    return outcomeUnknown(error) ? unknown : `Not switched: ${error.message}`;
  }
}

/** A mode as the switch calls it; the model's where a rig tells none. */
export function modeTitle(compensation) {
  const { mode, speed_mm_s } = compensation ?? { mode: "model" };
  return { model: "Model", fixed: `Fixed ${speed_mm_s} mm/s`, none: "Off" }[mode] ?? mode;
}

/** What a viewer must know of the mode, as the text of a badge; empty for the model's. */
export function remark(compensation) {
  const { mode, speed_mm_s } = compensation ?? { mode: "model" };
  if (mode === "model") return "";
  if (mode === "none") return "Not compensated: nothing makes up for finger and screen";
  if (mode === "fixed") return `Fixed compensation: as for ${speed_mm_s} mm/s at any speed`;
  return `Compensation: ${mode}`;
}
