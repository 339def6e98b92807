/** Add a study file to those in the folder of the service. */

import { request } from "../api.js";
import { element } from "../element.js";
import { labelled } from "../fields.js";
import { figure } from "../figures.js";
import { Outcome } from "../outcome.js";

/** What the service takes as a name. */
const NAME = /^[A-Za-z0-9_][A-Za-z0-9_.-]{0,95}\.h5$/;

export class Adding {
  /** @param {(name: string) => void} added is told of a study that the service has kept */
  constructor(added) {
    this.added = added;
    this.file = element("input", { type: "file", accept: ".h5" });
    this.file.addEventListener("change", () => this.#send());
    this.outcome = new Outcome();
    const label = labelled("Add a file of yours, .h5", this.file);
    this.root = element("div", { class: "fields" }, label, this.outcome.root);
  }

  async #send() {
    const [file] = this.file.files;
    if (file === undefined) return;
    if (!NAME.test(file.name)) {
      const accepted = "letters, digits, _, - and . before .h5, at most 96";
      this.outcome.bad(`${file.name} cannot be its name; accepted: ${accepted}. Rename the file.`);
      return;
    }
    this.file.disabled = true;
    this.outcome.good(`Sending ${file.name}, ${figure(file.size / 1e6, 3)} MB…`);
    const path = `/studies/${encodeURIComponent(file.name)}`;
    const headers = { "Content-Type": "application/x-hdf5" };
    const patient = new AbortController(); // no deadline: it may be large
    const sent = request("PUT", path, { body: file, headers, signal: patient.signal });
    const kept = await this.outcome.of(sent, `${file.name} is not added`);
    this.file.disabled = false;
    this.file.value = "";
    if (kept === null) return;
    this.outcome.good(`${kept.name} is added`);
    this.added(kept.name);
  }
}
