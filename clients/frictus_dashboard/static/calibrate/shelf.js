/** The calibrations of a rig, newest first. */

import { address } from "../address.js";
import { request } from "../connection/api.js";
import { element, say } from "../elements/element.js";
import { button } from "../elements/fields.js";
import { moment } from "../elements/figures.js";
import { Outcome } from "../elements/outcome.js";
import { fill, scrolling, table, words } from "../elements/table.js";

const PAGE = 20;
const HEAD = ["Begun", "Participant", "Protocol", "State", "Model"];

export class Shelf {
  /** @param {Element} root */
  constructor(root) {
    this.rig = null;
    this.calibrations = [];
    this.title = element("h2");
    this.table = table("The newest first", HEAD);
    this.outcome = new Outcome();
    this.more = button("Show older ones", () => {
      this.#get(`&after=${encodeURIComponent(this.next)}`, this.calibrations);
    });
    root.append(this.title, scrolling(this.table), this.outcome.root, this.more);
    root.classList.add("shelf");
  }

  /**
   * Read the list anew.
   *
   * @param {string} rig
   * @param {string|null} shown id of the one that is shown
   */
  async read(rig, shown) {
    if (rig !== this.rig) this.#put([], null);
    this.rig = rig;
    this.shown = shown;
    say(this.title, `Calibrations of ${rig}`);
    await this.#get("", []);
  }

  async #get(after, before) {
    const { rig } = this;
    const wanted = (this.wanted = {});
    const query = `rig=${encodeURIComponent(rig)}&limit=${PAGE}${after}`;
    const found = await this.outcome.of(request("GET", `/calibrations?${query}`), "Not listed");
    if (found === null || wanted !== this.wanted) return;
    this.#put([...before, ...found.calibrations], found.next);
    if (this.calibrations.length > 0) this.outcome.clear();
    else this.outcome.plain("None was started yet.");
  }

  #put(calibrations, next) {
    this.calibrations = calibrations;
    this.next = next;
    this.more.hidden = next === null;
    fill(this.table, calibrations.map((one) => this.#row(one)));
  }

  #row({ id, rig, created_utc_ns: createdNs, participant, spec, state, published }) {
    const link = element("a", { href: address("calibrate", rig, id) }, moment(createdNs));
    if (id === this.shown) link.setAttribute("aria-current", "true");
    const told = [participant, spec.protocol.kind, state, published ?? "–"];
    return [link, ...told.map((text) => words(text))];
  }
}
