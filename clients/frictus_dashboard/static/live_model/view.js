/** What is known of the finger on the screen now, whether the model fits it, what may change it. */

import { element, say } from "../elements/element.js";
import { Errors, Evidence } from "./bars.js";
import { LiveBode } from "./bode.js";
import { Changes } from "./changes.js";
import { coded } from "../elements/coded.js";
import { Parameters } from "./parameters.js";
import { Policy } from "./policy.js";
import { Tables } from "./tables.js";
import { viewStateOf } from "./view_state.js";

/** Without news it is looked at so often how old the newest is. */
const LOOK_MS = 500;

export class View {
  /** @param {HTMLElement} into @param {import("../views.js").Page} page */
  constructor(into, page) {
    this.page = page;
    this.into = into;
    this.timer = null;
    this.drawn = undefined;
    this.verdict = element("p", { class: "verdict", role: "status" });
    this.sentence = element("p", { class: "sentence" });
    this.advice = element("ul", { class: "advice" });
    this.age = element("p", { class: "age" });
    this.bode = new LiveBode();
    this.parameters = new Parameters();
    this.errors = new Errors();
    this.evidence = new Evidence();
    this.policy = new Policy(page);
    this.changes = new Changes();
    this.tables = new Tables();
    this.figures = [this.bode, this.parameters, this.errors, this.evidence, this.tables];
    const headline = element(
      "section",
      { class: "headline" },
      this.verdict,
      this.age,
      this.sentence,
      this.advice,
    );
    this.grid = element(
      "div",
      { class: "grid" },
      card("bode", "Friction per full drive, dB re 1 N", this.bode.root),
      card("history", "What is known over time", this.parameters.root),
      card("errors", "Gain so far: error of a rendering", this.errors.root),
      card("evidence", "Evidence against the model in force", this.evidence.root),
      card("policy", "What may change the model", this.policy.root, this.changes.root),
    );
    this.detail = element("section", {}, this.tables.root);
    into.append(headline, this.grid, this.detail);
  }

  open() {
    this.timer ??= setInterval(() => this.#show(), LOOK_MS);
    this.#show();
  }

  close() {
    clearInterval(this.timer);
    this.timer = null;
  }

  hear({ op }) {
    if (op === "estimate" || op === "status" || op === "lost") this.#show();
  }

  #show() {
    const { rig, estimates, state: { status } } = this.page.live;
    const { newest: estimate, entries } = estimates;
    const ageMs = estimates.ageMs(performance.now());
    const state = viewStateOf({ rig, status, estimate, ageMs, entries });
    this.into.dataset.kind = state.kind;
    this.into.classList.toggle("stale", state.stale);
    say(this.verdict, state.verdict);
    say(this.age, state.age);
    this.sentence.replaceChildren(...coded(state.sentence));
    this.advice.replaceChildren(...state.advice.map(({ title, text }) => {
      return element("li", {}, element("b", {}, title), " ", ...coded(text));
    }));
    this.policy.show(state);
    this.changes.show(state);
    if (estimate === this.drawn) return;
    this.drawn = estimate;
    this.grid.dataset.empty = state.groups === null;
    this.detail.hidden = estimate === null;
    for (const figure of this.figures) figure.show(state);
  }
}

function card(name, title, ...content) {
  const made = element("section", { class: `card ${name}` }, element("h2", {}, title), ...content);
  made.setAttribute("aria-label", title);
  return made;
}
