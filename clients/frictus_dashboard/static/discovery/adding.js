/** Add a study file to those in the folder of the service. */

import { request } from "../connection/api.js";
import { element } from "../elements/element.js";
import { labelled } from "../elements/fields.js";
import { figure } from "../elements/figures.js";
import { takeDrops } from "../elements/file_drop.js";
import { Outcome } from "../elements/outcome.js";

/** What the service takes as a name. */
const NAME = /^[A-Za-z0-9_][A-Za-z0-9_.-]{0,95}\.h5$/;

export class Adding {
  /** @param {(name: string) => void} added is told of a study that the service has kept */
  constructor(added) {
    this.added = added;
    this.file = element("input", { type: "file", accept: ".h5" });
    this.file.addEventListener("change", () => this.#send(this.file.files));
    this.outcome = new Outcome();
    const label = labelled("Add a file of yours, .h5: drop it anywhere here, or choose it", this.file);
    this.root = element("div", { class: "fields" }, label, this.outcome.root);
  }

  /** Take what is dropped while the view is shown. @param {AbortSignal} signal until then */
  listen(signal) {
    takeDrops(this.root, (files) => this.#send(files), signal);
  }

  async #send(files) {
    const [file] = files;
    if (file === undefined || this.file.disabled) return; // one is on its way
    if (files.length > 1) {
      this.outcome.bad("One file at a time: nothing was sent");
      return;
    }
    if (!file.name.endsWith(".h5")) {
      this.outcome.bad(
        `${file.name} is no .h5 file, as a study is: of a folder or an archive add the .h5 in it; ` +
          "frictus study import makes one of other recordings",
      );
      return;
    }
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
