/** One calibration: where it stands, what came of it, and what may be done with it now. */

import { request } from "../connection/api.js";
import { element, say } from "../elements/element.js";
import { button } from "../elements/fields.js";
import { moment } from "../elements/figures.js";
import { Outcome } from "../elements/outcome.js";
import { active, Following, pathOf } from "./following.js";
import { Progress } from "./progress.js";
import { Publishing } from "./publishing.js";
import { Result } from "./result.js";

const STATES = {
  queued: "Getting ready",
  running: "Running",
  done: "Done",
  failed: "Failed",
  interrupted: "Interrupted: it can go on where it ended",
  cancelled: "Cancelled: its trials are kept",
};
const RESUMABLE = ["interrupted", "failed"];
const CANCELLABLE = ["queued", "running", "interrupted"];

/** What is said of a phase between trials that takes long; else it runs. */
function stageOf({ phase, trials_done: done, message = "" }) {
  if (phase === "done") return "All trials are done, the finger may go; the model is being estimated";
  const preparing = phase === "analyse" && done === 0 && message.startsWith("preparing");
  return preparing ? `Getting ready: ${message}` : STATES.running;
}

export class Standing {
  /**
   * @param {Element} head what it is, and what may be done
   * @param {Element} body how far it is, and what came of it
   * @param {import("../views.js").Page} page
   * @param {() => void} changed it has another state, or is published
   */
  constructor(head, body, page, changed) {
    this.parts = [head, body];
    this.page = page;
    this.changed = changed;
    this.following = null;
    this.calibration = null;
    this.trusted = page.link.state === "open";
    this.title = element("h2");
    this.state = element("p", { class: "summary", role: "status" });
    this.failure = element("p", { class: "outcome", role: "alert", "data-outcome": "bad" });
    this.cancel = button("Cancel", () => this.#cancel());
    this.resume = button("Resume", () => this.#resume());
    this.outcome = new Outcome();
    const places = [1, 2, 3].map(() => element("div"));
    this.progress = new Progress(places[0]);
    this.publishing = new Publishing(places[1], page, changed);
    this.result = new Result(places[2]);
    const buttons = element("p", { class: "buttons" }, this.cancel, this.resume);
    head.append(this.title, this.state, this.failure, buttons, this.outcome.root);
    body.append(...places);
    this.open(null);
  }

  /** Show a calibration; null: none. */
  open(id) {
    if (this.following?.id === id) {
      this.following.again();
      return;
    }
    this.close();
    this.calibration = null;
    /** Whether progress came in: the process of a calibration takes seconds to begin. */
    this.moves = false;
    this.stopping = false;
    this.outcome.clear();
    this.progress.open();
    this.result.show(null);
    this.publishing.show(null);
    for (const part of this.parts) part.hidden = id === null;
    for (const part of [this.title, this.state, this.failure]) say(part, "");
    this.look();
    if (id === null) return;
    this.following = new Following(id, {
      stands: (calibration) => this.#stands(calibration),
      told: (event) => this.#told(event),
      broke: (error, final) => {
        this.outcome.bad(`${final ? "" : "No progress comes in: "}${error.message}`);
      },
    });
  }

  /** Stop following. */
  close() {
    this.following?.end();
    this.following = null;
  }

  /** Say what it is, or without a connection only what was heard last; `open` goes on. */
  trust(trusted) {
    this.trusted = trusted;
    if (!trusted) this.following?.end();
    this.look();
  }

  /** Offer what may be done now. */
  look() {
    const { calibration, page } = this;
    const may = calibration !== null && this.trusted && page.can("calibrate");
    this.cancel.hidden = !may || !CANCELLABLE.includes(calibration.state);
    this.cancel.disabled = this.stopping;
    this.resume.hidden = !may || !RESUMABLE.includes(calibration.state);
    this.publishing.look();
    if (calibration === null) return;
    const state = this.#inWords(calibration);
    say(this.state, this.trusted ? state : `It was last heard of as: ${state}`);
  }

  #inWords(calibration) {
    if (!active(calibration)) return STATES[calibration.state];
    if (this.stopping) return "It was told to stop";
    return this.moves ? stageOf(this.calibration.progress ?? {}) : STATES.queued;
  }

  #stands(calibration) {
    const before = this.calibration;
    this.calibration = calibration;
    if (!active(calibration)) this.moves = this.stopping = false;
    const { participant, spec, created_utc_ns: createdNs } = calibration;
    say(this.title, `${participant}, ${spec.protocol.kind} protocol, ${moment(createdNs)}`);
    say(this.failure, calibration.failure ?? "");
    this.outcome.clear();
    if (calibration.progress !== null) this.progress.show(calibration.progress, spec.protocol);
    if (calibration.result !== null) this.progress.forget(); // its notes have it
    this.result.show(calibration.result);
    this.publishing.show(calibration.result === null ? null : calibration);
    this.look();
    if (before !== null && before.state !== calibration.state) this.changed();
  }

  #told({ name, data }) {
    const { calibration } = this;
    // States are looked up, as they come with their outcome; a result has all in its notes.
    if (name !== "progress" || calibration.result !== null) return;
    this.progress.note(data.message);
    this.progress.show(data, calibration.spec.protocol);
    if (!active(calibration)) return;
    calibration.progress = data;
    const begins = !this.moves;
    this.moves = true;
    this.look();
    if (begins) this.changed();
  }

  #cancel() {
    this.stopping = true;
    this.look();
    return this.#act("Not cancelled", "DELETE", "");
  }

  #resume() {
    return this.#act("Not resumed", "POST", "/resume");
  }

  async #act(failed, method, path) {
    const { following } = this;
    const asked = request(method, `${pathOf(following.id)}${path}`);
    const done = await this.outcome.of(asked, failed);
    if (following !== this.following) return; // another one is shown
    if (done === null) this.stopping = false;
    else following.again();
    this.look();
  }
}
