/** Start and end a recording by the rig's recorder; what runs is what the recorder says. */

import { request } from "../connection/api.js";
import { element, say } from "../elements/element.js";
import { button } from "../elements/fields.js";
import { Outcome } from "../elements/outcome.js";
import { RecordingList } from "./list.js";
import { freshName, recordStateOf } from "./record_state.js";

export class Recorder {
  /** @param {Element} root an empty section with a heading */
  constructor(root) {
    this.rig = null;
    this.runs = null;
    this.suggested = "";
    this.outcome = new Outcome();
    this.list = new RecordingList();
    this.name = element("input", {
      type: "text",
      required: "",
      maxlength: "100",
      pattern: "[A-Za-z0-9._\\-]+",
      title: "1 to 100 letters, digits, '.', '_' and '-'",
      autocomplete: "off",
      spellcheck: "false",
    });
    this.start = element("button", { type: "submit" }, "Record");
    const label = element("label", {}, "Name of the recording", this.name);
    this.form = element("form", { class: "fields" }, label, this.start);
    this.form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.#begin();
    });
    this.end = button("End the recording", () => this.#end());
    this.text = element("p", { class: "recording-state" });
    root.append(this.form, this.end, this.text, this.outcome.root, this.list.root);
  }

  /** @param {object} heard as `recordStateOf` takes it */
  show(heard) {
    const { rig, recording } = heard;
    if (rig !== this.rig) {
      this.rig = rig;
      this.runs = null;
      this.outcome.clear();
      this.#suggest();
    }
    const runs = recording?.recording ?? null;
    if (runs !== this.runs) {
      if (this.runs !== null) this.outcome.clear(); // what was asked for has come, or is over
      if (this.runs === true && runs === false) this.#suggest();
      this.runs = runs;
      this.list.refresh();
    }
    const { kind, text, start, end } = recordStateOf(heard);
    this.text.dataset.kind = kind;
    say(this.text, text);
    this.form.hidden = !start;
    this.end.hidden = !end;
  }

  #suggest() {
    this.suggested = this.rig === null ? "" : freshName(this.rig, new Date());
    this.name.value = this.suggested;
  }

  async #begin() {
    const { rig } = this;
    if (this.name.value === this.suggested) this.#suggest(); // with the time of now
    const json = { name: this.name.value };
    await this.#ask(rig, `/rigs/${encodeURIComponent(rig)}/recordings`, { json }, "Not started");
  }

  async #end() {
    const { rig } = this;
    await this.#ask(rig, `/rigs/${encodeURIComponent(rig)}/recording/stop`, {}, "Not ended");
  }

  async #ask(rig, path, options, failure) {
    for (const each of [this.start, this.end]) each.disabled = true;
    this.outcome.clear();
    await this.outcome.of(request("POST", path, options), failure, () => rig === this.rig);
    for (const each of [this.start, this.end]) each.disabled = false;
  }
}
