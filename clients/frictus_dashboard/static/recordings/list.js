/** The recordings in the folder of the service's machine: when, how long, how large; each opens. */

import { request } from "../connection/api.js";
import { element, say } from "../elements/element.js";
import { button } from "../elements/fields.js";
import { Outcome } from "../elements/outcome.js";
import { fill, scrolling, table, words } from "../elements/table.js";
import { Opened } from "./opened.js";
import { length, size } from "./record_state.js";

const SHOWN = 50;
const WHEN = { dateStyle: "short", timeStyle: "short" };

export class RecordingList {
  constructor() {
    this.newest = null;
    this.outcome = new Outcome();
    this.note = element("p", { class: "quiet" });
    this.table = table("Recordings, the newest first", ["Name", "File", "When", "Length", "Size"]);
    this.place = scrolling(this.table);
    const summary = element("summary", {}, "Recordings");
    this.opened = new Opened();
    const parts = [this.note, this.place, this.outcome.root, this.opened.root];
    this.root = element("details", { class: "recordings" }, summary, ...parts);
    this.root.addEventListener("toggle", () => this.refresh());
  }

  /** Read the list anew, where it is open. */
  async refresh() {
    if (!this.root.open) return;
    const mine = (this.newest = {});
    const asked = request("GET", `/recordings?most=${SHOWN}`);
    const wanted = () => mine === this.newest;
    const found = await this.outcome.of(asked, "The list cannot be read", wanted);
    if (found === null || !wanted()) return;
    this.found = found;
    this.place.hidden = found.recordings.length === 0;
    const more = found.left_out > 0 ? ` ${found.left_out} older ones are not listed.` : "";
    say(this.note, found.recordings.length === 0 ? "There is none yet." : more);
    fill(this.table, found.recordings.map((one) => this.#row(one)));
  }

  #row({ name, modified_utc: when, seconds, bytes, finished }) {
    const file = finished ? this.#opening(name) : "not finished";
    return [
      name,
      words(file), // first of all: it is in reach on a phone
      new Date(when).toLocaleString(undefined, WHEN),
      length(seconds),
      size(bytes),
    ];
  }

  #opening(name) {
    const made = button("Open", () => this.opened.open(name, this.found));
    made.setAttribute("aria-label", `Open ${name}`);
    return made;
  }
}
