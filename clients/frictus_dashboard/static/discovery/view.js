/** What a model gets wrong in a study, and why: asked for, followed, read. */

import { address } from "../address.js";
import { element } from "../elements/element.js";
import { Asking } from "./asking.js";
import { Earlier } from "./earlier.js";
import { Job } from "./job.js";

/** The address names what is shown: `#/discovery/RIG/ID`. */
export class View {
  /** @param {HTMLElement} into @param {import("../views.js").Page} page */
  constructor(into, page) {
    this.page = page;
    this.rig = null;
    this.shown = null;
    /** Ends what goes on while the view is shown; null: it is not. */
    this.showing = null;
    const addressOf = (id) => address("discovery", this.rig ?? "", id);
    this.asking = new Asking(page, (id) => (location.hash = addressOf(id)));
    this.earlier = new Earlier(addressOf);
    this.job = new Job(page, () => this.earlier.load(this.shown));
    const above = element("div", { class: "columns" }, this.asking.root, this.earlier.root);
    into.append(above, this.job.root);
    page.link.addEventListener("state", ({ detail }) => {
      if (detail.state !== "open") this.job.lose();
    });
  }

  open(rig, rest) {
    this.rig = rig;
    this.shown = rest[0] ?? null;
    this.job.root.hidden = this.shown === null;
    if (this.page.link.welcome === null) return; // called again once it is let in
    this.showing?.abort();
    this.showing = new AbortController();
    if (this.page.can("calibrate")) this.asking.adding.listen(this.showing.signal);
    this.asking.load();
    this.earlier.load(this.shown);
    this.job.open(this.shown);
  }

  close() {
    this.showing?.abort();
    this.asking.close();
    this.job.close();
  }

  hear() {}
}
