/** What to do next where no rig is present, or nothing plays on the one that is shown. */

import { address } from "./address.js";
import { at, element, say } from "./element.js";

/** View, what to do, and what it is good for; no link is called as one of the views. */
const STEPS = [
  ["textures", "Choose a texture", "Put it on the screen, arm the rig, and slide a finger over it."],
  ["live-model", "See whether the model fits", "Live, while a finger follows the drive."],
  ["calibrate", "Measure a finger", "By a calibration, so that textures feel as designed."],
];

/**
 * @param {object} heard
 * @param {boolean} heard.connected whether the service answers, and has its router
 * @param {string|null} heard.rig the one that is shown
 * @param {object|null} heard.scene its newest SceneState
 * @param {boolean} heard.trusted whether the rig is there and speaks
 * @returns {{kind: "start"|"next"|"none"}} `start`: no rig is present; `next`: nothing plays
 */
export function firstStepOf({ connected, rig, scene, trusted }) {
  if (connected && rig === null) return { kind: "start" };
  const smooth = scene?.source === "scene" && scene.scene.regions.length === 0;
  return { kind: trusted && smooth ? "next" : "none" };
}

export class FirstSteps {
  constructor() {
    this.shown = "";
  }

  /** @param {{kind: string}} state of `firstStepOf` @param {string|null} rig */
  show({ kind }, rig) {
    at("first").hidden = kind === "none";
    const shown = `${kind} ${rig}`;
    if (shown === this.shown) return;
    this.shown = shown;
    const start = kind === "start";
    at("first-start").hidden = !start;
    at("first-cards").hidden = start;
    say(at("first-title"), start ? "No rig is present" : "Nothing plays: the screen is smooth");
    at("first-cards").replaceChildren(...(kind === "next" ? STEPS.map((step) => card(rig, step)) : []));
  }
}

function card(rig, [view, title, text]) {
  const link = element("a", { href: address(view, rig) }, title);
  return element("li", {}, link, element("p", {}, text));
}
