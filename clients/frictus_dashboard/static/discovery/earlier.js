/** The discoveries of this service, the newest first. */

import { request } from "../connection/api.js";
import { element } from "../elements/element.js";
import { moment } from "../elements/figures.js";
import { Outcome } from "../elements/outcome.js";
import { fill, table, words } from "../elements/table.js";
import { baseOf, stateOf, studyOf } from "./words.js";

const HEAD = ["Begun", "Study", "Model", "What came of it"];

export class Earlier {
  /** @param {(id: string) => string} addressOf of a discovery */
  constructor(addressOf) {
    this.addressOf = addressOf;
    this.table = table("The newest first", HEAD);
    this.outcome = new Outcome();
    const title = element("h2", {}, "Discoveries");
    this.root = element("section", {}, title, this.table, this.outcome.root);
  }

  /** @param {string|null} shown id of the discovery that is shown */
  async load(shown) {
    const wanted = (this.wanted = {});
    const found = await this.outcome.of(request("GET", "/discoveries"), "Not listed");
    if (found === null || wanted !== this.wanted) return;
    const { discoveries } = found;
    fill(this.table, discoveries.map((job) => {
      const link = element("a", { href: this.addressOf(job.id) }, moment(job.created_utc_ns));
      if (job.id === shown) link.setAttribute("aria-current", "true");
      const came = job.result?.sentence ?? job.failure ?? "";
      const what = came === "" ? stateOf(job) : `${stateOf(job)}: ${came}`;
      return [link, words(studyOf(job.spec)), words(baseOf(job.spec)), words(what)];
    }));
    if (discoveries.length > 0) this.outcome.clear();
    else this.outcome.plain("None was started yet.");
  }
}
