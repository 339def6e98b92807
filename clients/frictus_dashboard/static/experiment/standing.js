/** One experiment: where it stands, and what may be done with it now. */

import { address } from "../address.js";
import { request } from "../connection/api.js";
import { element, say } from "../elements/element.js";
import { button } from "../elements/fields.js";
import { moment } from "../elements/figures.js";
import { Outcome } from "../elements/outcome.js";
import { Following, pathOf } from "./following.js";
import { offersOf, progressOf, stateOf, trialOf } from "./words.js";

export class Standing {
  /**
   * @param {import("../views.js").Page} page
   * @param {(job: object, before: object|null) => void} changed it stands elsewhere
   */
  constructor(page, changed) {
    this.page = page;
    this.changed = changed;
    this.following = null;
    this.job = null;
    this.title = element("h2");
    this.state = element("p", { class: "summary", role: "status" });
    this.failure = element("p", { class: "outcome", role: "alert", "data-outcome": "bad" });
    this.count = element("p");
    this.trial = element("p", { class: "quiet" });
    this.bar = element("progress", { max: "1", "aria-label": "Trials answered" });
    this.pause = button("Pause", () => this.#act("Not paused", "POST", "/pause"));
    this.goOn = button("Go on", () => this.#act("It does not go on", "POST", "/resume"));
    this.stop = button("Stop the experiment", () => this.#act("Not stopped", "DELETE", ""));
    this.resume = button("Arm the rig and go on", () => this.#act("Not resumed", "POST", "/resume"));
    this.link = element("a", { target: "_blank", rel: "noopener" }, "The participant's page (new tab)");
    this.outcome = new Outcome();
    const buttons = [this.pause, this.goOn, this.stop, this.resume, this.link];
    /** Nothing is told of, or offered for, an experiment that was not heard of. */
    this.heard = element(
      "div",
      { hidden: "" },
      this.title,
      this.state,
      this.failure,
      this.bar,
      this.count,
      this.trial,
      element("p", { class: "buttons" }, ...buttons),
    );
    this.root = element("div", {}, this.heard, this.outcome.root);
  }

  /** Show an experiment, and follow it; null: none. */
  open(id) {
    this.close();
    if (id !== this.job?.id) this.job = null;
    this.heard.hidden = this.job === null;
    this.root.hidden = id === null;
    this.outcome.clear();
    if (id === null) return;
    this.following = new Following(id, {
      stands: (job) => this.#stands(job),
      broke: (error, final) => this.outcome.bad(`${final ? "" : "Nothing comes in: "}${error.message}`),
    });
  }

  /** Follow it no more. */
  close() {
    this.following?.end();
    this.following = null;
  }

  /** Offer what may be done now. */
  look() {
    const { job, page } = this;
    if (job === null) return;
    const may = page.link.state === "open" && page.can("calibrate");
    const { pause, goOn, stop, resume } = offersOf(job, may);
    this.pause.hidden = !pause;
    this.goOn.hidden = !goOn;
    this.stop.hidden = !stop;
    this.resume.hidden = !resume;
    const state = stateOf(job);
    say(this.state, page.link.state === "open" ? state : `It was last heard of as: ${state}`);
  }

  #stands(job) {
    const before = this.job;
    this.job = job;
    this.heard.hidden = false;
    this.outcome.clear();
    say(this.title, `${job.protocol}, ${job.participant}, ${moment(job.created_utc_ns)}`);
    say(this.failure, job.failure ?? "");
    say(this.count, progressOf(job));
    say(this.trial, trialOf(job));
    this.bar.hidden = job.screen === null || job.planned === null;
    if (!this.bar.hidden) this.bar.value = job.screen.answered / job.planned;
    this.state.dataset.state = job.state;
    this.link.href = address("participant", job.rig);
    this.look();
    this.changed(job, before);
  }

  async #act(failed, method, path) {
    const { following } = this;
    const asked = request(method, `${pathOf(following.id)}${path}`);
    const done = await this.outcome.of(asked, failed);
    // Its stream may have ended with it.
    if (done !== null && following === this.following) this.open(following.id);
  }
}
