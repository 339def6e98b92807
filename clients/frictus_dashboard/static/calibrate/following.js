/** What a calibration tells, over breaks of the connection: nothing missed, nothing twice. */

import { Refusal, request } from "../connection/api.js";
import { follow } from "../connection/events.js";

const PAUSE_MS = 500;
const TIMEOUT_MS = 5_000;
const ACTIVE = ["queued", "running"];

/** Whether a calibration has still to end. */
export function active(calibration) {
  return ACTIVE.includes(calibration.state);
}

/** The path of a calibration, below /v1. */
export function pathOf(id) {
  return `/calibrations/${encodeURIComponent(id)}`;
}

export class Following {
  #ending = new AbortController();
  #after = 0;

  /**
   * @param {string} id
   * @param {{stands: (calibration: object) => void, told: (event: object) => void,
   *   broke: (error: Error, final: boolean) => void}} take
   *   `stands`: the calibration as it is; `told`: one event of it; `broke`: nothing comes in,
   *   and it is tried again unless the service refused for good
   */
  constructor(id, take) {
    this.id = id;
    this.take = take;
    this.#run();
  }

  /** Ask again now, as after a break or a change; events go on behind the last one known. */
  again() {
    this.#ending.abort();
    this.#ending = new AbortController();
    this.#run();
  }

  end() {
    this.#ending.abort();
  }

  async #run() {
    const { signal } = this.#ending;
    while (!signal.aborted) {
      try {
        if (!(await this.#follow(signal))) return;
      } catch (error) {
        if (signal.aborted) return;
        const final = error instanceof Refusal && error.status < 500;
        this.take.broke(error, final);
        if (final) return;
      }
      await new Promise((resume) => setTimeout(resume, PAUSE_MS));
    }
  }

  /** Whether it runs on: then its stream ended because the service did. */
  async #follow(signal) {
    await this.#look(signal);
    const take = (event) => {
      if (signal.aborted) return; // another run of this has taken over
      this.#after = event.id;
      this.take.told(event);
    };
    await follow(`${pathOf(this.id)}/events`, take, { after: this.#after, signal });
    return active(await this.#look(signal));
  }

  async #look(signal) {
    const soon = AbortSignal.any([signal, AbortSignal.timeout(TIMEOUT_MS)]);
    const calibration = await request("GET", pathOf(this.id), { signal: soon });
    if (!signal.aborted) this.take.stands(calibration);
    return calibration;
  }
}
