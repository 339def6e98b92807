/** What came of something that was asked for, in words beside what asked for it. */

import { outcomeUnknown } from "../connection/api.js";
import { element, say } from "./element.js";

export class Outcome {
  constructor() {
    this.root = element("p", { class: "outcome", role: "status" });
  }

  /** What is neither good nor bad, as that there is nothing yet. */
  plain(text) {
    this.#tell(text, "");
  }

  good(text) {
    this.#tell(text, "good");
  }

  /** Neither is known yet. */
  unknown(text) {
    this.#tell(text, "unknown");
  }

  bad(text) {
    this.#tell(text, "bad");
  }

  clear() {
    this.#tell("", "");
  }

  /**
   * What a request answers; null where it fails, or its outcome is unknown, and then that is said.
   *
   * @template T
   * @param {Promise<T>} asked
   * @param {string} failure such as `Not moved`
   * @param {() => boolean} wanted false once the failure concerns nobody any more
   * @returns {Promise<T|null>}
   */
  async of(asked, failure, wanted = () => true) {
    try {
      return await asked;
    } catch (error) {
      if (!wanted()) return null;
      const unknown = `It is not known whether this was done: ${error.message}`;
      if (outcomeUnknown(error)) this.unknown(unknown);
      else this.bad(`${failure}: ${error.message}`);
      return null;
    }
  }

  #tell(text, outcome) {
    this.root.dataset.outcome = outcome;
    say(this.root, text);
  }
}
