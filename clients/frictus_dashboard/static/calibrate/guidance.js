/** What the participant follows: the reference above, the own finger below, to scale. */

import { colour } from "../canvas/colours.js";
import { element, say } from "../elements/element.js";
import { fitted, outline, toScale } from "../canvas/scale.js";

const WORDS_MS = 400;
/** While somebody slides thirty messages come a second: longer without, they have ended. */
const SILENT_MS = 1_000;
/** No trial takes so long to judge: who ran the session is gone, or has ended it. */
const GONE_MS = 30_000;
const SLIDING = ["approach", "record"];
/** Shares of the screen's height. */
const REFERENCE_Y = 0.3;
const FINGER_Y = 0.7;
const MIDDLE_Y = 0.5;
const SIDE = 0.24;
const PHASES = {
  approach: "Get going",
  record: "Recording",
  break: "Rest: the drive is off",
  analyse: "The trial is being judged",
  done: "All trials are done",
};
/** Said beside the colours, which not everybody tells apart. */
const FORCES = {
  green: "good",
  yellow: "press harder",
  red: "press more lightly",
  grey: "",
};

let made = 0;

export class Guidance {
  /** @param {Element} root */
  constructor(root) {
    this.root = root;
    const id = `guidance-words-${++made}`; // two views have one
    this.canvas = element("canvas", { role: "img", "aria-describedby": id });
    this.canvas.setAttribute("aria-label", "The guidance, to scale; the words have it too");
    this.pen = this.canvas.getContext("2d");
    this.phase = element("p", { class: "phase", role: "status" });
    this.left = element("p", { class: "number" });
    this.words = [1, 2, 3, 4, 5].map(() => element("p"));
    this.told = [this.phase, this.left, ...this.words];
    root.append(this.canvas, element("div", { id }, ...this.told));
    root.classList.add("guidance");
    this.screenMm = [0, 0];
    this.lose();
    new ResizeObserver(() => this.#fit()).observe(this.canvas);
  }

  /** @param {[number, number]} screenMm width and height */
  setScreen(screenMm) {
    if (String(screenMm) === String(this.screenMm)) return;
    this.screenMm = screenMm;
    this.canvas.style.aspectRatio = `${screenMm[0]} / ${screenMm[1]}`;
    this.#fit();
  }

  /** @param {object} state a GuidanceState */
  take(state) {
    // What was said last is kept for late joiners: only what follows is of now.
    this.firstNs ??= state.utc_ns;
    if (state.utc_ns === this.firstNs) return;
    if (this.state === null) requestAnimationFrame(() => this.#draw());
    this.state = state;
    this.heardMs = performance.now();
    this.root.hidden = this.screenMm[0] === 0;
    this.root.classList.remove("past");
  }

  /** Nothing is known of it any more, as for another rig. */
  lose() {
    this.state = this.drawn = this.firstNs = null;
    this.heardMs = this.toldMs = -Infinity;
    this.root.hidden = true;
    for (const part of this.told) say(part, "");
  }

  /** Look whether guidance still comes in; call a few times a second. */
  look() {
    const { drawn } = this;
    if (drawn === null) return;
    const silentMs = performance.now() - this.heardMs;
    if (silentMs > GONE_MS) {
      this.lose();
      return;
    }
    if (silentMs < SILENT_MS || drawn.phase === "analyse" || drawn.phase === "done") return;
    this.root.classList.add("past");
    for (const part of this.told) say(part, "");
    say(this.phase, "No guidance comes in");
    say(this.words[0], "Take your finger away, and wait.");
  }

  redraw() {
    if (this.drawn !== null) this.#paint(this.drawn);
  }

  /** Also where less motion is wanted: this motion is what the participant follows. */
  #draw() {
    if (this.state === null) return; // lost meanwhile
    const { state } = this;
    this.state = null;
    const changed = this.drawn?.phase !== state.phase || this.drawn?.trial !== state.trial;
    this.drawn = state;
    this.#paint(state);
    const nowMs = performance.now();
    if (!changed && nowMs - this.toldMs < WORDS_MS) return; // words that can be read
    this.toldMs = nowMs;
    this.#tell(state);
  }

  #tell(state) {
    const sliding = SLIDING.includes(state.phase);
    const timed = sliding || state.phase === "break";
    say(this.phase, PHASES[state.phase]);
    say(this.left, timed ? `${Math.ceil(state.seconds_left)} s` : "");
    const [speed, force] = timed ? task(state) : ["", ""];
    const [yourSpeed, yourForce] = sliding ? found(state) : ["", ""];
    const words = [place(state), speed, yourSpeed, force, yourForce];
    words.forEach((text, line) => say(this.words[line], text));
  }

  #paint(state) {
    const { pen } = this;
    pen.resetTransform();
    pen.clearRect(0, 0, this.canvas.width, this.canvas.height);
    const perMm = toScale(pen, this.screenMm);
    if (!(perMm > 0)) return; // out of sight
    const widthMm = this.screenMm[0];
    this.#paintScreen(state, perMm);
    const sliding = SLIDING.includes(state.phase);
    this.#square(state.reference_x_mm, REFERENCE_Y, perMm, sliding ? "--accent" : "--screen");
    if (!sliding) this.#text(PHASES[state.phase], widthMm / 2, MIDDLE_Y, perMm);
    else if (state.x_mm === null) this.#text("Touch the screen", widthMm / 2, MIDDLE_Y, perMm);
    else {
      this.#square(state.x_mm, FINGER_Y, perMm, `--guide-${state.colour}`);
      this.#text(FORCES[state.colour], state.x_mm, FINGER_Y + 0.75 * SIDE, perMm);
    }
  }

  #paintScreen(state, perMm) {
    const { pen } = this;
    const heightMm = this.screenMm[1];
    outline(pen, this.screenMm, perMm);
    pen.strokeStyle = colour("--grid");
    pen.lineWidth = 3;
    pen.beginPath();
    for (const y of [REFERENCE_Y, FINGER_Y]) {
      pen.moveTo(perMm * state.span_mm[0], perMm * y * heightMm);
      pen.lineTo(perMm * state.span_mm[1], perMm * y * heightMm);
    }
    pen.stroke();
  }

  #square(xMm, y, perMm, fill) {
    const { pen } = this;
    const heightPx = perMm * this.screenMm[1];
    const side = SIDE * heightPx;
    pen.fillStyle = colour(fill);
    pen.strokeStyle = colour("--ink");
    pen.lineWidth = 3;
    pen.beginPath();
    pen.roundRect(perMm * xMm - side / 2, y * heightPx - side / 2, side, side, 4);
    pen.fill();
    pen.stroke();
  }

  #text(text, xMm, y, perMm) {
    const { pen } = this;
    pen.font = "600 20px system-ui, sans-serif";
    pen.fillStyle = colour("--ink");
    pen.textAlign = "center";
    const half = pen.measureText(text).width / 2 + 6;
    const most = perMm * this.screenMm[0] - half;
    const x = Math.max(half, Math.min(most, perMm * xMm));
    pen.fillText(text, x, perMm * y * this.screenMm[1] + 7);
  }

  #fit() {
    if (fitted(this.canvas)) this.redraw();
  }
}

/** Whose trial it is, and what is said of it. */
function place({ participant, phase, trial, trials, message }) {
  if (phase === "done") return `Thank you, ${participant}: you may take your finger away`;
  const of = trials === null ? "" : ` of ${trials}`;
  return `${participant}, trial ${trial}${of}${message && `: ${message}`}`;
}

/** What is asked for of speed and force. */
function task({ target_speed_mm_s: speed, target_force_n: force }) {
  return [`Slide at ${speed} mm/s`, `Press with ${force.toFixed(2)} N`];
}

/** What the participant makes of that. */
function found({ x_mm: x, speed_mm_s: speed, force_n: force, colour: judged }) {
  if (x === null) return ["Your finger is not seen", ""];
  return [`You: ${speed.toFixed(0)} mm/s`, `You: ${force.toFixed(2)} N, ${FORCES[judged]}`];
}
