/** The friction felt over the last ten seconds by frequency: how its strength comes and goes. */

import { colour } from "../canvas/colours.js";
import { element, say } from "../elements/element.js";
import { power } from "./fourier.js";

/** 51 ms at 20 kHz. */
const SEGMENT = 1_024;
const COLUMNS = 196;
const TOP_HZ = 1_000;
/** Shown under the strongest of what is shown, dB. */
const DEPTH_DB = 40;
const FRICTION = 4;
/** 1 µN: what is weaker is nothing. */
const SILENT_DB = -120;

/**
 * Level of friction at each frequency of the transform, dB re 1 N rms. Pure.
 *
 * @param {Float64Array} samples a power of two of them
 * @returns {Float64Array} length n / 2 + 1; without the mean
 */
export function levels(samples) {
  const n = samples.length;
  const mean = samples.reduce((sum, value) => sum + value / n, 0);
  const hann = (i) => 0.5 - 0.5 * Math.cos((2 * Math.PI * i) / n);
  // A sine of 1 N rms has its whole power, 1 N², in the bin of its frequency.
  return power(samples.map((value, i) => (value - mean) * hann(i))).map(
    (square) => 10 * Math.log10(Math.max((8 * square) / n ** 2, 1e-30)),
  );
}

export class Spectrogram {
  /** @param {Element} root a figure */
  constructor(root) {
    this.root = root;
    this.canvas = element("canvas", { role: "img", width: String(COLUMNS), height: "1" });
    this.canvas.setAttribute("aria-label", "Friction by time and frequency; strongest in words");
    this.strongest = element("figcaption", {});
    const scale = element("p", { class: "scale", "aria-hidden": "true" });
    scale.append(...["1 kHz", "500 Hz", "0"].map((text) => element("span", {}, text)));
    const place = element("div", { class: "spectrogram" }, scale, this.canvas);
    root.append(element("h3", {}, "Friction felt, the last 10 s"), place, this.strongest);
    this.clear();
  }

  clear() {
    this.run = null;
    /** Device index of the sample that follows those taken; NaN: none was. */
    this.next = NaN;
    this.filled = 0;
    this.samples = new Float64Array(SEGMENT);
    /** Levels of each segment, the newest last; null: samples are missing. */
    this.columns = [];
    this.hz = 0;
    this.fresh = true;
  }

  /** Take a raw frame of `truth`. */
  push(frame) {
    if (!frame.raw) return;
    if (frame.run !== this.run || frame.firstSample !== this.next) this.#skip(frame);
    this.run = frame.run;
    this.next = frame.firstSample + frame.columns;
    this.hz = frame.sampleRateHz / SEGMENT;
    const friction = frame.low[FRICTION];
    for (let taken = 0; taken < frame.columns; ) {
      const count = Math.min(SEGMENT - this.filled, frame.columns - taken);
      this.samples.set(friction.subarray(taken, taken + count), this.filled);
      this.filled += count;
      taken += count;
      if (this.filled < SEGMENT) continue;
      this.#append(levels(this.samples).slice(0, Math.floor(TOP_HZ / this.hz) + 1));
      this.filled = 0;
    }
  }

  /** Leave as much out as is missing: lost, or nobody looked. Of another run that is not known. */
  #skip({ run, firstSample }) {
    const begun = this.next - this.filled;
    this.filled = 0;
    if (this.run === null) return;
    const missing = run === this.run ? Math.round((firstSample - begun) / SEGMENT) : 1;
    for (let i = Math.min(COLUMNS, Math.max(1, missing)); i > 0; i--) this.#append(null);
  }

  #append(column) {
    this.columns.push(column);
    if (this.columns.length > COLUMNS) this.columns.shift();
    this.fresh = true;
  }

  redraw() {
    this.fresh = true;
  }

  draw() {
    if (!this.fresh) return;
    this.fresh = false;
    const bins = Math.max(1, ...this.columns.map((column) => column?.length ?? 0));
    const image = new ImageData(COLUMNS, bins);
    const ink = Number.parseInt(colour("--accent").slice(1), 16);
    const highest = this.columns.map((column) => Math.max(...(column ?? [-Infinity])));
    const top = Math.max(SILENT_DB + DEPTH_DB, ...highest);
    this.columns.forEach((column, i) => {
      const x = COLUMNS - this.columns.length + i;
      column?.forEach((level, bin) => {
        const share = Math.max(0, 1 + (level - top) / DEPTH_DB);
        const pixel = 4 * ((bins - 1 - bin) * COLUMNS + x);
        image.data.set([ink >> 16, (ink >> 8) & 255, ink & 255, 255 * share], pixel);
      });
    });
    if (this.canvas.height !== bins) this.canvas.height = bins;
    this.canvas.getContext("2d").putImageData(image, 0, 0);
  }

  /** Bring the words up to date. */
  tell() {
    const newest = this.columns.at(-1) ?? null;
    if (newest === null) {
      say(this.strongest, "Nothing received");
      return;
    }
    const level = Math.max(...newest);
    if (level < SILENT_DB) {
      say(this.strongest, "Nothing is felt now");
      return;
    }
    const hz = this.hz * newest.indexOf(level);
    say(this.strongest, `Strongest now: ${hz.toFixed(0)} Hz, ${level.toFixed(0)} dB re 1 N rms`);
  }
}
