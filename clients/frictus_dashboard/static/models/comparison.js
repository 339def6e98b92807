/** Two models side by side: Bode plots at chosen speeds, and differences with intervals. */

import { request } from "../connection/api.js";
import { element, say } from "../elements/element.js";
import { labelled } from "../elements/fields.js";
import { Outcome } from "../elements/outcome.js";
import { Bode, MOST_SPEEDS } from "./bode.js";
import { differences } from "./differences.js";
import { referenceOf } from "./reference.js";

const DEFAULT_SPEEDS = "20, 60, 100";
const FASTEST_MM_S = 1_000;

export class Comparison {
  /** @param {(a: string, b: string) => void} choose two references */
  constructor(choose) {
    this.models = [];
    this.speedsMmS = speedsOf(DEFAULT_SPEEDS);
    this.a = element("input", { type: "text", required: "", maxlength: "200" });
    this.b = element("input", { type: "text", maxlength: "200" });
    this.speeds = element("input", { type: "text", required: "", value: DEFAULT_SPEEDS });
    const form = element(
      "form",
      { class: "fields" },
      labelled("Model A", this.a),
      labelled("Model B", this.b),
      labelled("Speeds, mm/s", this.speeds),
      element("button", { type: "submit" }, "Draw"),
    );
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      if (this.#takeSpeeds()) choose(this.a.value.trim(), this.b.value.trim());
    });
    this.outcome = new Outcome();
    this.note = element("p");
    this.bode = new Bode();
    this.differences = element("div");
    const title = element("h2", {}, "Side by side");
    const help = "A reference is a name, with a version or an alias behind @: rig1/P01@2.";
    const parts = [element("p", { class: "quiet" }, help), form, this.outcome.root, this.note];
    this.root = element("section", {}, title, ...parts, this.bode.root, this.differences);
  }

  /** @param {object[]} published one or two versions */
  async show(published) {
    this.models = published.map((each) => ({ name: referenceOf(each), model: each.model }));
    [this.a, this.b].forEach((input, i) => (input.value = this.models[i]?.name ?? ""));
    this.differences.replaceChildren();
    this.outcome.clear();
    const wanted = (this.wanted = {});
    this.#draw();
    if (published.length < 2) return;
    const [a, b] = this.models.map(({ name }) => name);
    const asked = request("GET", `/models/compare?${new URLSearchParams({ a, b })}`);
    const found = await this.outcome.of(asked, "Not compared");
    if (found === null || wanted !== this.wanted) return;
    this.differences.replaceChildren(...differences(found, a, b));
  }

  #takeSpeeds() {
    const speeds = speedsOf(this.speeds.value);
    if (speeds === null) {
      this.outcome.bad(`Speeds: up to ${MOST_SPEEDS} numbers from 0 to ${FASTEST_MM_S}`);
      return false;
    }
    this.outcome.clear();
    this.speedsMmS = speeds;
    if (this.models.length > 0) this.#draw();
    return true;
  }

  #draw() {
    const [first] = this.models;
    const alike = this.models.filter(({ model }) => model.base.law === first.model.base.law);
    const hidden = alike
      .filter(({ model }) => model.effects.length > 0)
      .map(({ name, model }) => `${name} (${model.effects.map(({ id }) => id).join(", ")})`);
    const left = hidden.length > 0 ? ` Effects are not drawn: ${hidden.join("; ")}.` : "";
    say(this.note, `Drawn are the base laws.${left}`);
    this.bode.show(alike, this.speedsMmS);
  }
}

/** The speeds that a text lists; null where it does not list any, or too many. */
export function speedsOf(text) {
  const parts = text.split(/[,;\s]+/).filter((part) => part !== "");
  const speeds = [...new Set(parts.map(Number))];
  const sound = speeds.every((speed) => speed >= 0 && speed <= FASTEST_MM_S);
  return sound && speeds.length >= 1 && speeds.length <= MOST_SPEEDS ? speeds : null;
}
