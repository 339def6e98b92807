/** Give the shown rig a published version, and say what the rig confirmed. */

import { request } from "../connection/api.js";
import { element, say } from "../elements/element.js";
import { button } from "../elements/fields.js";
import { Outcome } from "../elements/outcome.js";
import { facts } from "../elements/table.js";
import { referenceOf } from "./reference.js";

export class Activation {
  /** @param {import("../views.js").Page} page @param {() => void} done called when it is */
  constructor(page, done) {
    this.page = page;
    this.done = done;
    this.rig = this.version = this.told = null;
    this.button = button("", () => this.#activate());
    this.standing = element("p");
    this.kept = element("div");
    this.outcome = new Outcome();
    const title = element("h3", {}, "On the rig");
    const told = [title, this.standing, this.kept];
    this.root = element("div", {}, ...told, this.button, this.outcome.root);
  }

  /** @param {string|null} rig @param {object} version as published */
  open(rig, version) {
    if (rig !== this.rig || version.etag !== this.version?.etag) this.outcome.clear();
    this.rig = rig;
    this.version = version;
    say(this.button, `Activate on ${rig}`);
    this.show();
  }

  /** Follow what the rig says of itself. */
  show() {
    const { status, model } = this.page.state;
    this.button.hidden = this.rig === null || !this.page.can("calibrate");
    this.button.disabled = status?.state !== "disarmed";
    say(this.standing, this.#sentence(status, model));
    if (model === this.told) return;
    this.told = model;
    this.kept.replaceChildren(...this.#notRendered(model));
  }

  /** Whether the rig applies this version. */
  get active() {
    return this.page.state.model?.etag === this.version.etag;
  }

  #sentence(status, model) {
    if (this.rig === null) return "No rig is present.";
    if (model === null) return `Which model ${this.rig} applies is not known yet.`;
    if (this.active) return `✓ ${this.rig} applies this version.`;
    const other = model.model.placeholder ? "a placeholder" : "another model";
    const when = status?.state === "disarmed" ? "" : " It changes only while disarmed.";
    return `${this.rig} applies ${other}.${when}`;
  }

  #notRendered(model) {
    const left = Object.entries(this.active ? model.not_rendered : {});
    if (left.length === 0) return [];
    return [element("p", {}, "What the rig does not make good:"), facts(left)];
  }

  async #activate() {
    const { rig } = this;
    const reference = referenceOf(this.version);
    const path = `/rigs/${encodeURIComponent(rig)}/model/activate`;
    const { version } = this;
    const asked = this.page.settled(
      request("POST", path, { json: { model: reference } }),
      this.outcome,
      rig,
      ({ model }) => (model?.etag === version.etag ? { unnoted: true } : null),
    );
    const said = await this.outcome.of(asked, "Not activated");
    if (said === null) return;
    if (said.unnoted) {
      this.outcome.good(`${rig} applies it. Activate it again to have that noted.`);
      return;
    }
    const what = `${said.name}@${said.version}`;
    const remark = said.message ? ` ${said.message}.` : "";
    if (said.as_published) this.outcome.good(`${rig} confirmed ${what} as published.${remark}`);
    else this.outcome.bad(`${rig} applies something else than ${what}.${remark}`);
    this.done();
  }
}
