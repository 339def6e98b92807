/** What a discovery is asked: the study, the response, and the model that is criticised. */

import { request } from "../connection/api.js";
import { element } from "../elements/element.js";
import { choice, labelled, optionsOf } from "../elements/fields.js";
import { figure } from "../elements/figures.js";
import { pathOf, referenceOf } from "../models/reference.js";
import { Outcome } from "../elements/outcome.js";
import { Adding } from "./adding.js";

const MODELS = 200;
/** After which it is asked again whether there is a study, while there is none. */
const AGAIN_MS = 2000;
/** By response: bases that have a name. */
const NAMED = {
  friction: {
    paper: "The paper's speed law",
    "constant-cutoff": "A cutoff that knows no speed",
  },
  mobility: { paper: "The paper's finger" },
};
const RESPONSES = {
  friction: "Friction: drive to friction",
  mobility: "Mobility: friction to skin",
};

export class Asking {
  /** @param {import("../views.js").Page} page @param {(id: string) => void} started */
  constructor(page, started) {
    this.page = page;
    this.started = started;
    this.models = [];
    this.study = element("select", { required: "" });
    this.response = choice(Object.entries(RESPONSES));
    this.base = choice([]);
    this.button = element("button", { type: "submit" }, "Start");
    this.form = element(
      "form",
      { class: "fields" },
      labelled("Study", this.study),
      labelled("Response", this.response),
      labelled("Model that is criticised", this.base),
      this.button,
    );
    this.response.addEventListener("change", () => this.#offerBases());
    this.form.addEventListener("submit", (event) => (event.preventDefault(), this.#start()));
    this.adding = new Adding((name) => this.#choose(name));
    this.outcome = new Outcome();
    this.note = element("p", { class: "quiet" });
    this.note.append(
      "Every calibration is a study, too, and listed above. A recording becomes one by ",
      element("code", {}, "frictus export FILE --to h5"),
      ".",
    );
    const title = element("h2", {}, "What does a model get wrong?");
    const parts = [this.form, this.adding.root, this.note, this.outcome.root];
    this.root = element("section", {}, title, ...parts);
  }

  /** Ask which studies and models there are, again while there are none. */
  async load() {
    clearTimeout(this.again);
    const may = this.page.can("calibrate");
    for (const part of [this.form, this.adding.root, this.note]) part.hidden = !may;
    if (this.form.hidden) {
      this.outcome.plain("To start one takes a token with the scope calibrate.");
      return;
    }
    const asked = ["/studies", `/models?newest=true&limit=${MODELS}`];
    const all = Promise.all(asked.map((path) => request("GET", path)));
    const found = await this.outcome.of(all, "Not listed");
    if (found === null) return;
    const [{ studies }, { models }] = found;
    const sized = studies.map(({ name, bytes }) => {
      return [name, `${name} (${figure(bytes / 1e6, 3)} MB)`];
    });
    offer(this.study, optionsOf(sized));
    this.models = models;
    this.#offerBases();
    this.button.disabled = studies.length === 0;
    if (studies.length > 0) this.outcome.clear();
    else {
      this.outcome.plain("There is no study yet: add one below, or calibrate somebody.");
      this.again = setTimeout(() => this.load(), AGAIN_MS);
    }
  }

  async #choose(name) {
    await this.load();
    this.study.value = name;
  }

  /** Ask no more. */
  close() {
    clearTimeout(this.again);
  }

  #offerBases() {
    const response = this.response.value;
    const fitting = this.models.filter((model) => model.response === response).map(referenceOf);
    const published = fitting.map((name) => [pathOf(name), `Published: ${name}`]);
    offer(this.base, optionsOf([...Object.entries(NAMED[response]), ...published]));
  }

  async #start() {
    this.button.disabled = true;
    const job = await this.outcome.of(this.#ask(), "Not started");
    this.button.disabled = false;
    if (job === null) return;
    this.outcome.good(`Started with ${job.spec.study}`);
    this.started(job.id);
  }

  async #ask() {
    const [study, response] = [this.study.value, this.response.value];
    let base = this.base.value;
    if (!Object.hasOwn(NAMED[response], base)) base = await request("GET", `${base}/model.json`);
    return request("POST", "/discoveries", { json: { study, response, base } });
  }
}

/** Offer other choices, and keep the one that was made. */
function offer(select, choices) {
  const chosen = select.value;
  select.replaceChildren(...choices);
  if (choices.some(({ value }) => value === chosen)) select.value = chosen;
}
