/** One discovery: followed while it runs, its report when it is done. */

import { request } from "../connection/api.js";
import { save } from "../connection/download.js";
import { element, say } from "../elements/element.js";
import { follow } from "../connection/events.js";
import { button } from "../elements/fields.js";
import { moment } from "../elements/figures.js";
import { Outcome } from "../elements/outcome.js";
import { token } from "../connection/token.js";
import { picturesOf } from "./pictures.js";
import { report, reportAcross } from "./report.js";
import { ACTIVE, baseOf, stateOf, studyOf } from "./words.js";

export class Job {
  /** @param {import("../views.js").Page} page @param {() => void} changed its state has */
  constructor(page, changed) {
    this.page = page;
    this.changed = changed;
    this.id = null;
    this.#forget();
    this.title = element("h2");
    this.state = element("p", { class: "summary", role: "status" });
    this.newest = element("p", { role: "status" });
    this.told = element("ol");
    const summary = element("summary", {}, "What it told");
    this.log = element("details", {}, summary, this.told);
    this.cancel = button("Cancel", () => this.#cancel());
    this.outcome = new Outcome();
    this.files = element("p", { class: "fields" });
    this.report = element("div", { class: "report" });
    const running = [this.title, this.state, this.newest, this.cancel, this.outcome.root];
    this.root = element("section", {}, ...running, this.files, this.report, this.log);
  }

  /** Show a discovery, and follow it from where it is known; null: none. */
  async open(id) {
    this.close();
    this.root.hidden = id === null;
    if (id !== this.id) this.#show(id);
    if (id === null) return;
    const stop = (this.stop = new AbortController());
    const job = await this.outcome.of(request("GET", this.#path), "Not shown");
    if (job === null || stop.signal.aborted) return;
    this.outcome.clear();
    this.#tell(job);
    if (ACTIVE.includes(job.state)) await this.#follow(stop);
    else await this.#read(job, stop);
  }

  /** Follow it no more. */
  close() {
    this.stop.abort();
  }

  /** The connection is gone: what stands here is from before. */
  lose() {
    if (!this.active) return;
    this.close();
    this.cancel.hidden = true;
    this.outcome.bad("No word from the service: this is from before.");
  }

  get #path() {
    return `/discoveries/${encodeURIComponent(this.id)}`;
  }

  #forget() {
    this.stop = new AbortController();
    this.active = this.done = false;
    this.last = 0;
  }

  #show(id) {
    this.id = id;
    this.#forget();
    this.outcome.clear();
    say(this.title, `Discovery ${id}`);
    for (const part of [this.state, this.newest, this.told, this.files, this.report]) {
      part.replaceChildren();
    }
    this.log.hidden = true;
    this.cancel.hidden = true;
  }

  #tell(job) {
    this.active = ACTIVE.includes(job.state);
    const asked = `${job.spec.response} of ${studyOf(job.spec)} against ${baseOf(job.spec)}`;
    say(this.title, `${asked}, ${moment(job.created_utc_ns)}`);
    this.#say(job.state);
    this.cancel.hidden = !this.active || !this.page.can("calibrate");
    if (job.failure !== null) this.outcome.bad(job.failure);
  }

  #say(state) {
    this.state.dataset.state = state;
    say(this.state, stateOf({ state }));
  }

  async #follow(stop) {
    const take = (event) => this.#take(event);
    try {
      await follow(`${this.#path}/events`, take, { after: this.last, signal: stop.signal });
    } catch (error) {
      if (!stop.signal.aborted) this.outcome.bad(`Not followed any more: ${error.message}`);
      return;
    }
    const job = await this.outcome.of(request("GET", this.#path), "Not shown");
    if (job === null || stop.signal.aborted) return;
    this.#tell(job);
    this.changed();
    await this.#read(job, stop);
  }

  #take({ id, name, data }) {
    this.last = id;
    if (name === "state") {
      this.#say(data);
      this.changed();
    } else {
      say(this.newest, data.message);
      this.told.append(element("li", {}, data.message));
      this.log.hidden = false;
    }
  }

  async #read(job, stop) {
    say(this.newest, "");
    if (job.state !== "done" || this.done) return;
    const found = await this.outcome.of(request("GET", `${this.#path}/report`), "No report");
    if (found === null || stop.signal.aborted) return;
    this.done = true;
    this.files.replaceChildren(...this.#links());
    const one = found.schema === "discovery/1";
    const parts = one ? report(found, job.result.sentence) : reportAcross(found);
    this.report.replaceChildren(...parts);
    const pictures = picturesOf(this.#path, stop.signal);
    const figures = await this.outcome.of(pictures, "No figures", () => !stop.signal.aborted);
    if (figures === null || figures.length === 0 || stop.signal.aborted) return;
    this.report.append(element("h3", {}, "Figures"), ...figures);
  }

  /** With a token a link would not be let in, and a page made here would have no style. */
  #links() {
    const path = `${this.#path}/report.html`;
    const name = `discovery-${this.id}.html`;
    const saving = button("Save the report with figures", async () => {
      const saved = save(path, name).then(() => name);
      const done = await this.outcome.of(saved, "Not saved");
      if (done !== null) this.outcome.good(`Saved ${done}`);
    });
    if (token() !== null) return [saving];
    const where = { href: `/v1${path}`, target: "_blank", rel: "noopener" };
    return [element("a", where, "Open the report with figures (new tab)"), saving];
  }

  async #cancel() {
    const job = await this.outcome.of(request("DELETE", this.#path), "Not cancelled");
    if (job !== null) this.outcome.good("It was told to stop.");
  }
}
