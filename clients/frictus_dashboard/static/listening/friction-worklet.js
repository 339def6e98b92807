/** Plays the samples that are sent to it, in order; silence where they are late. */

const MOST_BEHIND = 0.25; // seconds; older samples are left out, so that sound follows touch

class Friction extends AudioWorkletProcessor {
  #queue = [];
  #queued = 0;
  #played = 0;
  #last = 0;

  constructor() {
    super();
    this.port.onmessage = ({ data }) => {
      this.#queue.push(data);
      this.#queued += data.length;
      while (this.#queued > MOST_BEHIND * sampleRate && this.#queue.length > 1) this.#next();
    };
  }

  process(_inputs, [[output]]) {
    for (let i = 0; i < output.length; i++) {
      if (this.#queue.length > 0) {
        this.#last = this.#queue[0][this.#played++];
        if (this.#played === this.#queue[0].length) this.#next();
      }
      output[i] = this.#last; // held: a jump to zero would click
    }
    return true;
  }

  #next() {
    this.#queued -= this.#queue.shift().length;
    this.#played = 0;
  }
}

registerProcessor("friction", Friction);
