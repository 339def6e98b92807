/** The experimenter's page: set an experiment up, follow it, see what comes of it. */

import { address } from "../address.js";
import { request } from "../connection/api.js";
import { element, say } from "../elements/element.js";
import { moment } from "../elements/figures.js";
import { Outcome } from "../elements/outcome.js";
import { fill, scrolling, table, words } from "../elements/table.js";
import { active } from "./following.js";
import { Results } from "./results.js";
import { Setup } from "./setup.js";
import { Standing } from "./standing.js";
import { stateOf } from "./words.js";

const HEAD = ["Begun", "Protocol", "Participant", "State"];

/** The address names what is shown: `#/experiment/RIG/ID`. */
export class View {
  /** @param {HTMLElement} into @param {import("../views.js").Page} page */
  constructor(into, page) {
    this.page = page;
    this.rig = null;
    this.wanted = null;
    this.shown = false;
    this.standing = new Standing(page, (job, before) => this.#changed(job, before));
    this.results = new Results();
    this.setup = new Setup((job) => (location.hash = address("experiment", job.rig, job.id)));
    this.new = element("div", {}, element("h2", {}, "A new experiment"), this.setup.root);
    this.note = element("p", { class: "quiet" });
    this.earlier = table("The newest first", HEAD);
    this.outcome = new Outcome();
    const kept = element("div", {}, element("h2", {}, "Experiments"), scrolling(this.earlier), this.outcome.root);
    this.below = element("div", { class: "columns" }, this.new, kept);
    into.append(this.standing.root, this.results.root, this.note, this.below);
    page.link.addEventListener("state", () => this.standing.look());
  }

  open(rig, rest) {
    this.rig = rig;
    this.wanted = rest[0] ?? null;
    this.shown = true;
    const may = this.page.can("calibrate");
    this.new.hidden = !may;
    this.below.hidden = rig === null;
    const known = this.page.link.welcome !== null;
    say(this.note, known && !may ? "To start one takes a token with the scope calibrate." : "");
    this.#showStatus();
    // Without a connection nothing is asked: with it, this is called again.
    if (this.page.link.state !== "open") return;
    this.standing.open(this.wanted);
    this.#read(this.wanted);
    this.#list();
  }

  close() {
    this.shown = false;
    this.standing.close();
  }

  hear(message) {
    if (message.rig === this.rig && message.op === "status") this.#showStatus();
  }

  #showStatus() {
    const { status } = this.page.state;
    this.setup.show(this.rig, status?.owner ?? null, this.page.link.welcome?.client ?? "");
  }

  /** Levels and answers are for who may calibrate. */
  #read(id) {
    this.results.read(this.page.can("calibrate") ? id : null);
  }

  #changed(job, before) {
    const told = before?.id === job.id && stateOf(before) === stateOf(job);
    if (!told) this.#list();
    // Practice is answered, too, and counts for nothing: its trial alone tells.
    const { trial = null, answered = null } = job.screen ?? {};
    const same = before?.screen?.trial === trial && before.screen.answered === answered;
    if (!told || !same) this.#read(job.id);
  }

  /** Read the list; without an address of its own, the one under way is shown. */
  async #list() {
    const { rig } = this;
    if (rig === null) return;
    const query = `/experiments?rig=${encodeURIComponent(rig)}`;
    const found = await this.outcome.of(request("GET", query), "Not listed");
    if (found === null || rig !== this.rig || !this.shown) return;
    const { experiments, more, ready } = found;
    this.setup.offer(ready);
    fill(this.earlier, experiments.map((job) => this.#row(job)));
    if (more) this.outcome.plain(`The newest ${experiments.length} are listed; there are older ones.`);
    else if (experiments.length > 0) this.outcome.clear();
    else this.outcome.plain("None was started yet.");
    const under = experiments.find(active);
    if (this.wanted === null && under !== undefined) {
      location.replace(address("experiment", rig, under.id));
    }
  }

  #row(job) {
    const link = element("a", { href: address("experiment", job.rig, job.id) }, moment(job.created_utc_ns));
    if (job.id === this.wanted) link.setAttribute("aria-current", "true");
    return [link, words(job.protocol), words(job.participant), words(stateOf(job))];
  }
}
