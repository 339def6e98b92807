/** The model of a calibration: what it is good for, published under a name, given to the rig. */

import { address } from "../address.js";
import { request } from "../connection/api.js";
import { element, say } from "../elements/element.js";
import { labelled } from "../elements/fields.js";
import { Activation } from "../models/activation.js";
import { pathOf as pathOfModel, referenceOf } from "../models/reference.js";
import { Outcome } from "../elements/outcome.js";
import { adviceOf } from "./advice.js";
import { pathOf } from "./following.js";

export class Publishing {
  /**
   * @param {Element} root
   * @param {import("../views.js").Page} page
   * @param {() => void} changed it is published
   */
  constructor(root, page, changed) {
    this.root = root;
    this.page = page;
    this.changed = changed;
    this.calibration = null;
    /** What was published, once the service has said it. */
    this.version = null;
    this.name = element("input", { name: "name", maxlength: "129" });
    this.comment = element("input", { name: "comment", maxlength: "1000" });
    this.form = element(
      "form",
      { class: "fields" },
      labelled("Name", this.name),
      labelled("Comment", this.comment),
      element("button", { type: "submit" }, "Publish"),
    );
    this.form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.#publish();
    });
    this.advice = element("div", { class: "advice" });
    this.next = element("p", { class: "next", role: "status" });
    this.told = element("p", { role: "status" });
    this.outcome = new Outcome();
    this.activation = new Activation(page, () => {});
    const title = element("h3", {}, "What came of it");
    const parts = [title, this.advice, this.next, this.form, this.outcome.root, this.told, this.activation.root];
    root.append(...parts);
    this.show(null);
  }

  /** @param {object|null} calibration null: none that has a model */
  show(calibration) {
    const other = calibration?.id !== this.calibration?.id;
    this.calibration = calibration;
    this.root.hidden = calibration === null;
    if (other) {
      const sentences = calibration === null ? [] : adviceOf(calibration);
      this.advice.replaceChildren(...sentences.map((text) => element("p", {}, text)));
      this.version = null;
      this.outcome.clear();
      this.comment.value = "";
      // As the service names it by itself.
      this.name.value = calibration && `${calibration.rig}/${calibration.participant}`;
    }
    this.look();
    if (calibration?.published && this.version === null) this.#read();
  }

  /** Say what the rig makes of it now, and offer what may be done. */
  look() {
    const { calibration, version } = this;
    if (calibration === null) return;
    const may = this.page.can("calibrate");
    const published = version !== null || calibration.published !== null;
    this.form.hidden = published || !may;
    this.activation.root.hidden = version === null;
    if (version !== null) this.activation.open(this.page.live.rig, version);
    if (!published) say(this.told, "");
    say(this.next, this.#next(published, may));
  }

  #next(published, may) {
    const { rig } = this.page.live;
    if (!may) return published ? "" : "Not published: that needs the scope calibrate.";
    if (!published) return `Next: Publish, then Activate here; until then ${rig} renders with the model that it has.`;
    if (this.version === null || !this.activation.active) return `Next: Activate on ${rig}, here.`;
    return `${rig} renders for this finger now: arm it, and feel a texture under Textures.`;
  }

  async #publish() {
    const { id } = this.calibration;
    const json = { name: this.name.value || null, comment: this.comment.value };
    const asked = request("POST", `${pathOf(id)}/publish`, { json });
    const version = await this.outcome.of(asked, "Not published");
    if (version === null || this.calibration?.id !== id) return;
    this.#put(version);
    this.changed();
  }

  async #read() {
    const { id, published } = this.calibration;
    const asked = request("GET", pathOfModel(published));
    const version = await this.outcome.of(asked, `${published} did not come`);
    if (version !== null && this.calibration?.id === id) this.#put(version);
  }

  #put(version) {
    this.version = version;
    this.outcome.clear();
    const reference = referenceOf(version);
    const link = { href: address("models", this.calibration.rig, reference) };
    this.told.replaceChildren("Published as ", element("a", link, reference));
    this.look();
  }
}
