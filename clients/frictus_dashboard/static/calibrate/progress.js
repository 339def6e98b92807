/** How far a calibration is: counts, seconds, precision, and what had to be done again. */

import { element, say } from "../elements/element.js";
import { figure } from "../elements/figures.js";

/** What only tells that it goes on; reasons of a rejection say what would be accepted. */
const GOING_ON = /^(trial \S+ accepted|estimating the model|preparing; .*)$/;

export class Progress {
  /** @param {Element} root */
  constructor(root) {
    this.readings = Object.fromEntries(
      ["Trials", "Rejected", "Recorded", "Precision"].map((name) => [name, new Reading(name)]),
    );
    const rows = Object.values(this.readings).map((reading) => reading.root);
    this.title = element("h3", {}, "What to know of the trials");
    this.mishaps = element("ul", { class: "mishaps", tabindex: "0" });
    this.mishaps.setAttribute("aria-label", this.title.textContent);
    this.again = element("div", {}, this.title, this.mishaps);
    root.append(element("div", { class: "readings" }, ...rows), this.again);
    this.root = root;
    this.open();
  }

  /** Begin with another calibration. */
  open() {
    this.forget();
    this.root.hidden = true;
  }

  /** What was noted is told elsewhere, or of another calibration. */
  forget() {
    this.mishaps.replaceChildren();
    this.again.hidden = true;
  }

  /** @param {object} progress a Progress @param {object} protocol that of its spec */
  show(progress, protocol) {
    this.root.hidden = false;
    const { trials_done: done, trials_planned: planned, precision } = progress;
    const { Trials, Rejected, Recorded, Precision } = this.readings;
    const of = planned === null ? "done" : `of ${planned} planned`;
    Trials.show(String(done), of);
    Rejected.show(String(progress.trials_rejected), "of them");
    const most = protocol.max_recorded_s;
    const recorded = most === undefined ? "s" : `s of ${most} s at most`;
    Recorded.show(progress.recorded_s.toFixed(0), recorded);
    const { precision: wanted } = protocol;
    Precision.root.hidden = wanted === undefined;
    if (wanted === undefined) return; // such a protocol ends by its plan
    const found = precision === null ? "–" : `${(100 * precision).toFixed(1)} %`;
    Precision.show(found, `where ${figure(100 * wanted)} % is wanted`);
  }

  /** Note what was said beside the numbers, unless it only goes on. */
  note(message) {
    if (message === "" || GOING_ON.test(message)) return;
    this.mishaps.prepend(element("li", {}, message));
    this.again.hidden = false;
  }
}

class Reading {
  constructor(name) {
    this.number = element("span", { class: "number" });
    this.words = element("span");
    this.root = element("p", { class: "reading" }, `${name} `, this.number, " ", this.words);
  }

  show(number, words) {
    say(this.number, number);
    say(this.words, words);
  }
}
