/** What to do next: where no rig is present, where nothing plays, and on a demo's stage. */

import { address } from "./address.js";
import { at, element, say } from "./elements/element.js";

/** View, what to do, and what it is good for; no link is called as one of the views. */
const STEPS = [
  ["textures", "Choose a texture", "Put it on the screen, arm the rig, and slide a finger over it."],
  ["live-model", "See whether the model fits", "Live, while a finger follows the drive."],
  ["calibrate", "Measure a finger", "By a calibration, so that textures feel as designed."],
];

/** What a visitor can do who has seen the stage: view, what, and how. */
const NEXT = [
  ["calibrate", "Measure this finger", "Press STOP, then start a calibration: this simulated finger follows its guidance by itself, and turns out to feel twice what a new rig assumes (0.39 N)."],
  ["discovery", "Find what a model gets wrong", "In the sample study laboratory_next_door.h5 an effect is hidden: choose it, press Start, and a discovery names it within seconds."],
  ["textures", "Stream a recording of yours", "A WAV file becomes a texture that this finger feels."],
];
const OF = {
  next: { title: "Nothing plays: the screen is smooth", cards: STEPS },
  stage: { title: "And now?", cards: NEXT },
};

/**
 * @param {object} heard
 * @param {boolean} heard.connected whether the service answers, and has its router
 * @param {string|null} heard.rig the one that is shown
 * @param {object|null} heard.scene its newest SceneState
 * @param {boolean} heard.trusted whether the rig is there and speaks
 * @param {boolean} heard.tripped whether it is tripped: nothing is to be done but what the fault says
 * @param {boolean} heard.stage whether its finger strokes by itself until it is taken over
 * @returns {{kind: "start"|"next"|"stage"|"none"}} `start`: no rig is present; `next`: nothing
 *   plays; `stage`: a demo plays
 */
export function firstStepOf({ connected, rig, scene, trusted, tripped, stage }) {
  if (connected && rig === null) return { kind: "start" };
  if (tripped) return { kind: "none" };
  const smooth = scene?.source === "scene" && scene.scene.regions.length === 0;
  if (trusted && smooth) return { kind: "next" };
  return { kind: trusted && stage ? "stage" : "none" };
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
    if (kind === "stage") at("live").append(at("first")); // after what there is to be seen
    else at("rig").before(at("first"));
    const { title, cards } = OF[kind] ?? { title: "No rig is present", cards: [] };
    say(at("first-title"), title);
    at("first-cards").replaceChildren(...cards.map((step) => card(rig, step)));
  }
}

function card(rig, [view, title, text]) {
  const link = element("a", { href: address(view, rig) }, title);
  return element("li", {}, link, element("p", {}, text));
}
