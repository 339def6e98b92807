/** Where an experiment stands, as it changes, over breaks of the connection. */

import { Refusal, request } from "../connection/api.js";
import { follow } from "../connection/events.js";

const PAUSE_MS = 500;
const ACTIVE = ["queued", "running"];

/** Whether an experiment has still to end. */
export function active(job) {
  return ACTIVE.includes(job.state);
}

/** The path of an experiment, below /v1. */
export function pathOf(id) {
  return `/experiments/${encodeURIComponent(id)}`;
}

/** Give the answer to the question that is on the screen. */
export function send(job, answer) {
  const { trial, step } = job.screen;
  return request("POST", `${pathOf(job.id)}/answers`, { json: { trial, step, answer } });
}

export class Following {
  #ending = new AbortController();

  /**
   * @param {string} id
   * @param {{stands: (job: object) => void, broke: (error: Error, final: boolean) => void}} take
   *   `stands`: the experiment as it is now; `broke`: nothing comes in, and it is tried again
   *   unless the service refused for good
   */
  constructor(id, take) {
    this.id = id;
    this.take = take;
    this.#run();
  }

  end() {
    this.#ending.abort();
  }

  async #run() {
    const { signal } = this.#ending;
    let running = true;
    const stands = ({ data }) => {
      if (signal.aborted) return;
      running = active(data);
      this.take.stands(data);
    };
    while (running && !signal.aborted) {
      try {
        await follow(`${pathOf(this.id)}/events`, stands, { signal });
      } catch (error) {
        if (signal.aborted) return;
        const final = error instanceof Refusal && error.status < 500;
        this.take.broke(error, final);
        if (final) return;
      }
      if (running) await new Promise((resume) => setTimeout(resume, PAUSE_MS));
    }
  }
}
