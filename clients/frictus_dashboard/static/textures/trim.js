/** The part of a recording that becomes a texture: seen, heard, chosen by hand or typed. */

import { colour, onSchemeChange } from "../canvas/colours.js";
import { element, say } from "../elements/element.js";
import { labelled, number } from "../elements/fields.js";
import { figure } from "../elements/figures.js";
import { fitted } from "../canvas/scale.js";
import { levelled, Sound } from "./sound.js";
import { drawWave, samplesOf } from "./waveform.js";

/** Drawn parts begin and end at whole milliseconds. */
const STEP_S = 1e-3;

export class Trim {
  constructor() {
    this.canvas = element("canvas", { class: "wave", role: "img" });
    this.from = number({ min: 0 });
    this.to = number({ min: 0 });
    this.note = element("p", { class: "quiet", role: "status" });
    this.sound = new Sound("Listen to the part", () => this.#heard());
    const fields = element("div", { class: "fields" });
    fields.append(labelled("Part from, s", this.from), labelled("Part to, s", this.to));
    fields.append(this.sound.button);
    this.root = element("div", { class: "trim" }, this.canvas, fields, this.note);
    fields.addEventListener("input", () => this.#judge());
    this.canvas.addEventListener("pointerdown", (event) => this.#down(event));
    this.canvas.addEventListener("pointermove", (event) => this.#move(event));
    for (const name of ["pointerup", "pointercancel"]) {
      this.canvas.addEventListener(name, () => (this.start = null));
    }
    new ResizeObserver(() => fitted(this.canvas) && this.#draw()).observe(this.canvas);
    onSchemeChange(() => this.#draw());
    this.clear();
  }

  clear() {
    this.asked = this.recorded = this.start = null;
    this.sound.stop();
    this.root.hidden = true;
    for (const field of [this.from, this.to]) field.disabled = true;
  }

  /** Show a recording; what cannot be drawn is taken whole. Parameters as of `samplesOf`. */
  async show(file, suffix, how) {
    this.clear();
    const asked = (this.asked = {});
    const recorded = await samplesOf(file, suffix, how);
    if (asked !== this.asked || recorded === null) return;
    this.recorded = recorded;
    this.root.hidden = false;
    for (const field of [this.from, this.to]) {
      field.disabled = false;
      field.max = this.#endS;
    }
    this.#choose(0, this.#endS);
    fitted(this.canvas);
    this.#draw();
  }

  /** What the service is told of the part; nothing where it is the whole. */
  get query() {
    const whole = this.recorded === null || (this.#ends[0] === 0 && this.#ends[1] === this.#endS);
    return whole ? {} : { part_from_s: this.from.value, part_to_s: this.to.value };
  }

  get #endS() {
    const { samples, rateHz } = this.recorded;
    return Number((samples.length / rateHz).toFixed(6));
  }

  get #ends() {
    return [this.from.valueAsNumber, this.to.valueAsNumber];
  }

  #choose(fromS, toS) {
    this.from.value = fromS;
    this.to.value = toS;
    this.#judge();
  }

  #judge() {
    const [from, to] = this.#ends;
    const wrong = !(from < to);
    this.to.setCustomValidity(wrong ? "The part has to end behind where it begins" : "");
    const part = wrong ? "No part" : `${figure(to - from)} s`;
    const how = "Drag over the waveform, or type where it begins and ends.";
    say(this.note, `${part} of ${figure(this.#endS)} s becomes the texture. ${how}`);
    this.canvas.setAttribute("aria-label", `Waveform of the recording, ${figure(this.#endS)} s`);
    this.#draw();
  }

  #heard() {
    const { samples, rateHz } = this.recorded;
    const [begin, end] = this.#ends.map((s) => Math.round(s * rateHz));
    if (!(begin < end)) return null;
    return { samples: levelled(samples.slice(begin, end)), rateHz, loop: false };
  }

  #down(event) {
    if (this.recorded === null || event.button !== 0) return;
    this.canvas.setPointerCapture(event.pointerId);
    this.start = this.#timeOf(event);
  }

  #move(event) {
    if (this.start === null) return;
    const [from, to] = [this.start, this.#timeOf(event)].sort((a, b) => a - b);
    if (to - from >= STEP_S) this.#choose(from, to);
  }

  #timeOf(event) {
    const { left, width } = this.canvas.getBoundingClientRect();
    const share = Math.min(1, Math.max(0, (event.clientX - left) / width));
    if (share === 1) return this.#endS;
    return Number((Math.round((share * this.#endS) / STEP_S) * STEP_S).toFixed(3));
  }

  #draw() {
    const { canvas, recorded } = this;
    if (recorded === null || canvas.width === 0) return;
    drawWave(canvas, recorded.samples);
    const pen = canvas.getContext("2d");
    const [begin, end] = this.#ends.map((s) => (canvas.width * s) / this.#endS);
    if (!(begin < end)) return;
    pen.globalAlpha = 0.75;
    pen.fillStyle = colour("--ground"); // what is left out is dimmed
    pen.fillRect(0, 0, begin, canvas.height);
    pen.fillRect(end, 0, canvas.width - end, canvas.height);
    pen.globalAlpha = 1;
    pen.fillStyle = colour("--accent");
    for (const x of [begin, end - 2]) pen.fillRect(x, 0, 2, canvas.height);
  }
}
