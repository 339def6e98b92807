/** What came of something that was asked for, in words beside what asked for it. */

import { element, say } from "./element.js";

export class Outcome {
  constructor() {
    this.root = element("p", { class: "outcome", role: "status" });
  }

  good(text) {
    this.#tell(text, "good");
  }

  bad(text) {
    this.#tell(text, "bad");
  }

  clear() {
    this.#tell("", "");
  }

  /**
   * What a request answers; null where it fails, and then it is said why.
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
      if (wanted()) this.bad(`${failure}: ${error.message}`);
      return null;
    }
  }

  #tell(text, outcome) {
    this.root.dataset.outcome = outcome;
    say(this.root, text);
  }
}
