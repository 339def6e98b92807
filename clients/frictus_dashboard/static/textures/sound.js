/** A button that plays samples as sound, and stops them. */

import { say } from "../elements/element.js";
import { button } from "../elements/fields.js";

const RATE_HZ = 48_000;

export class Sound {
  /**
   * @param {string} name of the button while it is silent
   * @param {() => {samples: ArrayLike<number>, rateHz: number, loop: boolean}|null} make
   *   what is heard, within -1 to 1; null: nothing
   */
  constructor(name, make) {
    this.name = name;
    this.make = make;
    this.context = null;
    this.button = button(name, () => (this.context === null ? this.#play() : this.stop()));
    this.button.setAttribute("aria-pressed", "false");
  }

  stop() {
    this.context?.close();
    this.context = null;
    this.button.setAttribute("aria-pressed", "false");
    say(this.button, this.name);
  }

  #play() {
    const made = this.make();
    if (made === null) return;
    const samples = resampled(made.samples, made.rateHz, RATE_HZ);
    const context = (this.context = new AudioContext({ sampleRate: RATE_HZ }));
    const buffer = new AudioBuffer({ length: samples.length, sampleRate: RATE_HZ });
    buffer.copyToChannel(samples, 0);
    const source = new AudioBufferSourceNode(context, { buffer, loop: made.loop });
    source.connect(context.destination);
    source.addEventListener("ended", () => context === this.context && this.stop());
    source.start();
    this.button.setAttribute("aria-pressed", "true");
    say(this.button, "Stop the sound");
  }
}

/** Samples at another rate, by straight lines. Pure. @returns {Float32Array} */
export function resampled(samples, rateHz, toHz) {
  const length = Math.max(1, Math.round((samples.length * toHz) / rateHz));
  return Float32Array.from({ length }, (_, i) => {
    const at = Math.min((i * rateHz) / toHz, samples.length - 1);
    const before = Math.floor(at);
    const after = Math.min(before + 1, samples.length - 1);
    return samples[before] + (at - before) * (samples[after] - samples[before]);
  });
}

/** Samples whose largest magnitude is a half; silence stays silence. Pure. */
export function levelled(samples) {
  const peak = samples.reduce((most, value) => Math.max(most, Math.abs(value)), 0);
  return peak === 0 ? samples : samples.map((value) => (0.5 * value) / peak);
}
