/** The friction as sound; silent until somebody asks for it. */

import { at, say } from "../elements/element.js";

const BAND_HZ = [20, 1_000];

export class Hearing {
  constructor() {
    this.context = null;
    this.node = null;
    this.rateHz = 0;
    at("hear").addEventListener("click", () => this.#toggle());
    at("volume").addEventListener("input", () => this.#setVolume());
  }

  get on() {
    return this.node !== null;
  }

  /** Play a raw frame of `truth`. */
  push(frame) {
    this.rateHz = frame.sampleRateHz;
    if (this.on && frame.raw) this.node.port.postMessage(frame.low[4].slice());
  }

  async #toggle() {
    const button = at("hear");
    if (this.context !== null) {
      const { context } = this;
      this.context = this.node = null;
      button.setAttribute("aria-pressed", "false");
      say(button, "Hear the friction");
      await context.close();
      return;
    }
    if (this.rateHz === 0) return; // nothing has come yet that could be heard
    button.setAttribute("aria-pressed", "true");
    say(button, "Stop the sound");
    const context = new AudioContext({ sampleRate: this.rateHz });
    this.context = context;
    await context.audioWorklet.addModule("listening/friction-worklet.js");
    if (this.context !== context) return; // switched off meanwhile
    this.node = new AudioWorkletNode(context, "friction", { numberOfInputs: 0 });
    this.volume = new GainNode(context);
    this.#setVolume();
    this.node
      .connect(new BiquadFilterNode(context, { type: "highpass", frequency: BAND_HZ[0] }))
      .connect(new BiquadFilterNode(context, { type: "lowpass", frequency: BAND_HZ[1] }))
      .connect(this.volume)
      .connect(context.destination);
  }

  #setVolume() {
    // A tenth of a newton at full volume is half of full scale.
    if (this.context !== null) this.volume.gain.value = 5 * Number(at("volume").value);
  }
}
