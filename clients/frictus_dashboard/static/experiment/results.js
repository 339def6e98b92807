/** What the trials of an experiment say so far: thresholds, curves, the trials themselves. */

import { request } from "../connection/api.js";
import { save } from "../connection/download.js";
import { element, say } from "../elements/element.js";
import { button } from "../elements/fields.js";
import { figure } from "../elements/figures.js";
import { Outcome } from "../elements/outcome.js";
import { fill, scrolling, table, words } from "../elements/table.js";
import { Curve } from "./curve.js";
import { pathOf } from "./following.js";

const HEAD = ["Trial", "Kind", "Condition", "Level", "As rendered", "Answer", "Right", "Time, s", "Flags"];

export class Results {
  constructor() {
    this.id = null;
    this.curves = [];
    this.conditions = element("div", { class: "columns" });
    this.trials = table("The newest trials first", HEAD);
    this.save = button("Save the table of events", () => this.#save());
    this.outcome = new Outcome();
    const list = element("details", { open: "" }, element("summary", {}, "Trials"), scrolling(this.trials));
    this.root = element("section", {}, this.conditions, this.save, this.outcome.root, list);
    this.root.hidden = true;
  }

  /** Read what an experiment says; null: none is shown. */
  async read(id) {
    if (id !== this.id) this.root.hidden = true;
    this.id = id;
    if (id === null) return;
    const found = await this.outcome.of(request("GET", `${pathOf(id)}/report`), "No results");
    if (found === null || id !== this.id) return;
    this.outcome.clear();
    this.#show(found);
  }

  #show({ trials, left_out: leftOut, conditions }) {
    const older = leftOut === 0 ? "" : `; ${leftOut} older ones stand in the table of events`;
    say(this.trials.caption, `The newest trials first${older}`);
    this.root.hidden = trials.length === 0;
    fill(this.trials, trials.map(row));
    const names = conditions.map(({ condition }) => condition).join();
    if (names !== this.curves.map(({ name }) => name).join()) {
      this.curves = conditions.map(({ condition }) => new Curve(condition));
      this.conditions.replaceChildren(...this.curves.map(({ root }) => root));
    }
    conditions.forEach((condition, i) => this.curves[i].show(condition));
  }

  async #save() {
    const name = `experiment-${this.id}_events.tsv`;
    const saved = save(`${pathOf(this.id)}/events.tsv`, name).then(() => name);
    const done = await this.outcome.of(saved, "Not saved");
    if (done !== null) this.outcome.good(`Saved ${done}`);
  }
}

function row(trial) {
  const right = { 1: "yes", 0: "no" }[trial.correct] ?? "–";
  return [
    String(trial.trial),
    words(trial.trial_type),
    words(trial.condition),
    figure(trial.level, 3),
    figure(trial.level_rendered, 3),
    trial.response,
    words(right),
    trial.response_time.toFixed(2),
    words(trial.flags ?? ""),
  ];
}
