/** Who moved which alias of a model, and which rigs were given a version. */

import { request } from "../connection/api.js";
import { element } from "../elements/element.js";
import { moment } from "../elements/figures.js";
import { Outcome } from "../elements/outcome.js";
import { fill, scrolling, table, words } from "../elements/table.js";
import { pathOf } from "./reference.js";

const MOVES = ["When", "Alias", "From", "To", "By", "Why"];
const ACTIVATIONS = ["When", "Rig", "Version", "By", "The rig applied"];

export class Audit {
  constructor() {
    this.moves = table("Aliases moved, newest first", MOVES);
    this.activations = table("Given to rigs, newest first", ACTIVATIONS);
    this.outcome = new Outcome();
    const summary = element("summary", {}, "Who moved aliases, and gave versions to rigs");
    const tables = [scrolling(this.moves), scrolling(this.activations)];
    this.root = element("details", {}, summary, ...tables, this.outcome.root);
  }

  /** @param {string} name of the model */
  async open(name) {
    const wanted = (this.wanted = {});
    const found = await this.outcome.of(request("GET", `${pathOf(name)}/audit`), "Not read");
    if (found === null || wanted !== this.wanted) return;
    this.outcome.clear();
    fill(this.moves, found.moves.map((move) => [
      moment(move.moved_utc_ns),
      words(move.alias),
      move.from_version === null ? "new" : String(move.from_version),
      String(move.to_version),
      words(move.moved_by),
      words(move.reason),
    ]));
    fill(this.activations, found.activations.map((each) => [
      moment(each.activated_utc_ns),
      words(`${each.site}/${each.rig}`),
      String(each.version),
      words(each.activated_by),
      words(each.confirmed === each.etag ? "as published" : "something else"),
    ]));
  }
}
