/** The friction as sound; silent until somebody asks for it. */

import { at, say } from "../elements/element.js";

const BAND_HZ = [20, 1_000];

export class Hearing {
  constructor() {
    this.context = null;
    this.node = null;
    this.volume = null;
    this.rateHz = 0;
    this.button = at("hear");
    this.button.disabled = true; // until something has come that could be heard
    this.button.addEventListener("click", () => this.#toggle());
    at("volume").addEventListener("input", () => this.#setVolume());
  }

  get on() {
    return this.node !== null;
  }

  /** Play a raw frame of `truth`. */
  push(frame) {
    // At the rate of another rig it would be heard too high, or too low.
    if (frame.sampleRateHz !== this.rateHz) this.#stop();
    this.rateHz = frame.sampleRateHz;
    this.button.disabled = false;
    if (this.on && frame.raw) this.node.port.postMessage(frame.low[4].slice());
  }

  async #toggle() {
    say(at("hear-outcome"), "");
    if (this.context !== null) {
      this.#stop();
      return;
    }
    this.button.setAttribute("aria-pressed", "true");
    say(this.button, "Stop the sound");
    try {
      await this.#play();
    } catch (error) {
      this.#stop();
      say(at("hear-outcome"), `No sound: ${error.message}`);
    }
  }

  async #play() {
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

  #stop() {
    this.context?.close();
    this.context = this.node = this.volume = null;
    this.button.setAttribute("aria-pressed", "false");
    say(this.button, "Hear the friction");
  }

  #setVolume() {
    // A tenth of a newton at full volume is half of full scale.
    if (this.volume !== null) this.volume.gain.value = 5 * Number(at("volume").value);
  }
}
