/** One published version: where it comes from, where it holds, what it adds to the base law. */

import { element, say } from "../elements/element.js";
import { button } from "../elements/fields.js";
import { figure, interval, moment } from "../elements/figures.js";
import { save } from "../connection/download.js";
import { Outcome } from "../elements/outcome.js";
import { facts, scrolling, table, words } from "../elements/table.js";
import { measuredOn, pathOf, referenceOf } from "./reference.js";

const FILES = ["model.json", "model.mat"];

export class Version {
  constructor() {
    this.title = element("h2");
    this.body = element("div");
    this.outcome = new Outcome();
    const buttons = FILES.map((file) => button(`Save ${file}`, () => this.#save(file)));
    const downloads = element("p", { class: "fields" }, ...buttons);
    this.root = element("div", {}, this.title, this.body, downloads, this.outcome.root);
  }

  /** @param {object} published */
  show(published) {
    this.published = published;
    this.outcome.clear();
    say(this.title, referenceOf(published));
    this.body.replaceChildren(...described(published));
  }

  async #save(file) {
    const { name, version } = this.published;
    const called = `${name.replace("/", "-")}-${version}${file.slice("model".length)}`;
    const path = `${pathOf(referenceOf(this.published))}/${file}`;
    const saved = save(path, called).then(() => called);
    const done = await this.outcome.of(saved, "Not saved");
    if (done !== null) this.outcome.good(`Saved ${done}`);
  }
}

function described(published) {
  const { model } = published;
  const { law, ...parameters } = model.base;
  const validity = model.validity;
  return [
    facts([
      ["Of", published.participant ?? "population"],
      ["Measured on rig", measuredOn(published)],
      ["Published", `${moment(published.published_utc_ns)} by ${published.published_by}`],
      ["Comment", published.comment],
      ["Calibration", published.calibration],
      ["Response", `${model.response}, law ${law}`],
      ...Object.entries(parameters).map(([name, value]) => [name, plain(value)]),
      ["Valid speeds", `${interval(validity.speed_mm_s)} mm/s`],
      ["Valid forces", `${interval(validity.normal_force_n)} N`],
      ["Valid drive", `${interval(validity.drive_vpp)} Vpp`],
    ]),
    ...effects(model.effects),
    element("details", {}, element("summary", {}, "How it was measured"), provenance(model)),
  ];
}

function provenance(model) {
  return facts(Object.entries(model.provenance).map(([name, value]) => [name, plain(value)]));
}

function effects(found) {
  if (found.length === 0) return [];
  const rows = found.map(({ id, parameters }) => {
    const told = Object.entries(parameters).map(([name, value]) => `${name} ${figure(value)}`);
    return [id.replaceAll("_", " "), words(told.join(", "))];
  });
  return [scrolling(table("What it adds to the base law", ["Effect", "Parameters"], rows), true)];
}

/** What provenance holds is of any kind. */
function plain(value) {
  if (typeof value === "number") return figure(value, 6);
  if (typeof value === "string") return value;
  if (Array.isArray(value) && value.every((each) => typeof each === "string")) {
    return value.join(", ");
  }
  return element("pre", {}, JSON.stringify(value, null, 2));
}
