/** Published models: which there are, where they come from, two side by side, on the rig. */

import { address } from "../address.js";
import { request } from "../connection/api.js";
import { element } from "../elements/element.js";
import { Outcome } from "../elements/outcome.js";
import { Activation } from "./activation.js";
import { Aliases } from "./aliases.js";
import { Audit } from "./audit.js";
import { Comparison } from "./comparison.js";
import { Listing } from "./listing.js";
import { pathOf, referenceOf } from "./reference.js";
import { Version } from "./version.js";

/** The address names what is shown: `#/models/RIG/A/B`, references of one or two versions. */
export class View {
  /** @param {HTMLElement} into @param {import("../views.js").Page} page */
  constructor(into, page) {
    this.page = page;
    this.rig = null;
    this.shown = [];
    const addressOf = (...references) => address("models", this.rig ?? "", ...references);
    this.listing = new Listing(addressOf);
    this.version = new Version();
    this.aliases = new Aliases(page, { addressOf, moved: () => this.#readAudit() });
    this.activation = new Activation(page, () => this.#readAudit());
    this.audit = new Audit();
    this.comparison = new Comparison((a, b) => {
      location.hash = addressOf(...[a, b].filter((reference) => reference !== ""));
    });
    this.outcome = new Outcome();
    this.details = element("div", {});
    const parts = [this.version, this.activation, this.aliases, this.audit];
    this.details.append(...parts.map(({ root }) => root));
    this.chosen = element("section", {}, this.outcome.root, this.details);
    into.append(
      element("div", { class: "columns" }, this.listing.root, this.chosen),
      this.comparison.root,
    );
    this.details.hidden = this.comparison.root.hidden = true; // until a version is chosen
  }

  open(rig, rest) {
    this.rig = rig;
    if (this.page.link.welcome === null) return; // called again once it is let in
    this.listing.load();
    this.#show(rest.slice(0, 2));
  }

  close() {}

  hear(message) {
    if (message.op !== "status" && message.op !== "model") return;
    if (this.shown.length > 0) this.activation.show();
    this.#mark();
  }

  async #show(references) {
    const wanted = (this.wanted = {});
    const asked = Promise.all(references.map((each) => request("GET", pathOf(each))));
    const found = await this.outcome.of(asked, "Not shown");
    if (wanted !== this.wanted) return;
    this.shown = found ?? [];
    this.details.hidden = this.comparison.root.hidden = this.shown.length === 0;
    this.#mark();
    if (found === null) return;
    if (found.length === 0) {
      this.outcome.plain("Choose a model to see where it comes from.");
      return;
    }
    this.outcome.clear();
    const [version] = found;
    this.version.show(version);
    this.activation.open(this.rig, version);
    this.comparison.show(found);
    await Promise.all([this.aliases.open(version), this.audit.open(version.name)]);
  }

  #readAudit() {
    this.audit.open(this.shown[0].name);
  }

  #mark() {
    const [version] = this.shown;
    const active = this.page.state.model?.etag ?? null;
    this.listing.mark(version ? referenceOf(version) : null, active);
  }
}
