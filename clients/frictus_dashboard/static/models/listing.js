/** Which models are published: filters, and a page of the list at a time. */

import { request } from "../connection/api.js";
import { element } from "../elements/element.js";
import { button, labelled } from "../elements/fields.js";
import { moment } from "../elements/figures.js";
import { Outcome } from "../elements/outcome.js";
import { fill, scrolling, table, words } from "../elements/table.js";
import { measuredOn, referenceOf } from "./reference.js";

const PAGE = 50;
const NONE_YET = "None is published yet: a calibration measures one, and its page publishes it.";
const HEAD = ["Model", "Of", "Rig", "Published", "On the rig"];

export class Listing {
  /** @param {(reference: string) => string} addressOf of a version */
  constructor(addressOf) {
    this.addressOf = addressOf;
    this.found = [];
    this.next = null;
    this.shown = { reference: null, active: null };
    this.rig = field("Measured on rig", "text");
    this.participant = field("Participant", "text");
    this.newest = field("Newest versions only", "checkbox");
    this.newest.input.checked = true;
    this.table = table("Published models, newest first", HEAD);
    this.more = button("Show more", () => this.#load(this.next));
    this.outcome = new Outcome();
    const fields = [this.rig, this.participant, this.newest];
    const form = element("form", { class: "fields" }, ...fields.map(({ label }) => label));
    form.append(element("button", { type: "submit" }, "Filter"));
    form.addEventListener("submit", (event) => (event.preventDefault(), this.load()));
    this.newest.input.addEventListener("change", () => this.load());
    const title = element("h2", {}, "Published models");
    const body = [form, scrolling(this.table, true), this.more, this.outcome.root];
    this.root = element("section", {}, title, ...body);
  }

  /** Ask for the list anew. */
  load() {
    return this.#load(0);
  }

  /** Mark the version that is shown, and those that the rig applies. */
  mark(reference, activeEtag) {
    const { shown } = this;
    if (shown.reference === reference && shown.active === activeEtag) return;
    this.shown = { reference, active: activeEtag };
    this.#draw();
  }

  async #load(after) {
    const newest = this.newest.input.checked;
    const asked = new URLSearchParams({ limit: PAGE, newest, after });
    /** What the list is filtered by; empty: nothing. */
    this.asked = "";
    for (const name of ["rig", "participant"]) {
      const given = this[name].input.value.trim();
      if (given) asked.set(name, given);
      this.asked += given;
    }
    const wanted = (this.wanted = {});
    const page = await this.outcome.of(request("GET", `/models?${asked}`), "No list");
    if (page === null || wanted !== this.wanted) return;
    this.found = after ? [...this.found, ...page.models] : page.models;
    this.next = page.next;
    this.#draw();
  }

  #draw() {
    const { reference, active } = this.shown;
    fill(this.table, this.found.map((version) => {
      const name = referenceOf(version);
      const link = element("a", { href: this.addressOf(name) }, name);
      if (name === reference) link.setAttribute("aria-current", "true");
      const on = version.etag === active ? "active" : "";
      const of = version.participant ?? "population";
      return [link, words(of), words(measuredOn(version)), moment(version.published_utc_ns), on];
    }));
    this.more.hidden = this.next === null;
    if (this.found.length > 0) this.outcome.clear();
    else this.outcome.plain(this.asked === "" ? NONE_YET : "No published model fits the filter.");
  }
}

function field(title, type) {
  const input = element("input", { type });
  return { input, label: labelled(title, input) };
}
