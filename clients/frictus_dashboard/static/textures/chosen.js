/** The texture that is previewed: read, felt on the rig, edited, deleted. */

import { element, say } from "../elements/element.js";
import { button } from "../elements/fields.js";
import { Outcome } from "../elements/outcome.js";
import { Editor } from "./editor.js";
import { Preview } from "./preview.js";
import { replaceScene, sceneIn, words } from "./scene.js";
import { deleteTexture, readTexture } from "./stored.js";

export class Chosen {
  /**
   * @param {Element} into
   * @param {import("../views.js").Page} page
   * @param {{edit: (name: string, texture: object, etag: string|null) => void,
   *   deleted: () => void, changed: () => void}} tell `etag` null: a copy is edited;
   *   `changed`: the library is not what was read of it
   */
  constructor(into, page, tell) {
    this.page = page;
    this.tell = tell;
    this.rig = this.name = this.summary = null;
    /** What is previewed: `texture`, and its `etag`, null for a draft. */
    this.shown = null;
    /** The read that is under way; null: none. */
    this.asked = null;
    this.removal = false;
    this.title = element("h2");
    this.feel = button("Feel it", () => this.#feel());
    this.edit = button("Edit", () => this.#edit());
    // The second click of a double one is no answer to the question.
    this.remove = button("Delete", ({ detail }) => detail < 2 && this.#remove());
    this.holder = element("p", { class: "quiet" });
    this.outcome = new Outcome();
    this.reading = new Outcome();
    const buttons = element("p", { class: "actions-row" }, this.feel, this.edit, this.remove);
    into.append(this.title, buttons, this.holder, this.outcome.root, this.reading.root);
    this.preview = new Preview(into);
    this.#offer();
  }

  /**
   * Show a texture of the library.
   *
   * @param {string|null} rig where it would be felt
   * @param {string|null} name
   * @param {object|null} summary as the list has it; null where it has none
   */
  open(rig, name, summary) {
    const [otherRig, other] = [rig !== this.rig, name !== this.name];
    this.rig = rig;
    this.name = name;
    this.summary = summary;
    if (other) this.outcome.clear();
    const outdated = this.shown?.etag && summary && this.shown.etag !== `"${summary.etag}"`;
    const missing = this.shown === null && this.asked === null;
    if (other || outdated || missing) this.read();
    else if (otherRig) this.renew();
    this.#offer();
  }

  /** Show what the library holds, in place of a draft, too. */
  async read() {
    const { name } = this;
    this.asked = this.shown = null;
    this.removal = false;
    this.reading.clear();
    this.preview.clear();
    this.#offer();
    // It is opened again when the service is there.
    if (name === null || this.page.link.state !== "open") return;
    const asked = (this.asked = {});
    const still = () => asked === this.asked;
    const found = await this.reading.of(readTexture(name), `No preview of ${name}`, still);
    if (!still()) return;
    this.asked = null;
    if (found !== null) this.#show(found);
  }

  /** Show what is being edited. @param {object} texture */
  draft(texture) {
    this.asked = null;
    this.reading.clear();
    this.#show({ texture, etag: null });
  }

  /** The rig speaks: what could not be told of it before may be known now. */
  hear() {
    if (this.preview.unsure) this.renew();
    this.#offer();
  }

  /** The rig may be able to give another part of it now. */
  renew() {
    if (this.shown !== null) this.preview.show(this.shown.texture, this.rig);
  }

  #show(shown) {
    this.shown = shown;
    this.removal = false;
    this.#offer();
    this.renew();
  }

  get #draft() {
    return this.shown !== null && this.shown.etag === null;
  }

  /** Show the buttons that may be pressed. */
  #offer() {
    const { shown, summary } = this;
    const may = this.page.can("render");
    const saved = Boolean(shown?.etag);
    say(this.title, this.#draft ? "The draft, not saved" : (this.name ?? "Choose a texture"));
    this.feel.hidden = !may || this.rig === null || shown === null;
    this.feel.disabled = this.page.keptOut !== "";
    say(this.holder, this.feel.hidden ? "" : this.page.keptOut);
    this.edit.hidden = !may || !saved || !Editor.takes(shown.texture);
    say(this.edit, summary?.shipped ? "Edit a copy" : "Edit");
    const own = summary !== null && !summary.shipped;
    this.remove.hidden = !may || !own || !(saved || summary.damaged);
    say(this.remove, this.removal ? `Delete ${this.name} for good` : "Delete");
  }

  async #feel() {
    const { rig } = this;
    const name = this.#draft ? "draft" : this.name;
    const scene = { name, regions: [{ name, texture: this.shown.texture }] };
    const asked = replaceScene(rig, scene, "*");
    const settled = this.page.settled(asked, this.outcome, rig, sceneIn(scene));
    const done = await this.outcome.of(settled, `${name} is not on ${rig}`);
    if (done === null) return;
    const arm = this.page.state.status?.state === "armed" ? "" : ". Arm the rig to feel it";
    this.outcome.good(`${name} is on ${rig}: ${words(done.applied)}${arm}`);
  }

  #edit() {
    const { texture, etag } = this.shown;
    this.tell.edit(this.name, texture, this.summary?.shipped ? null : etag);
  }

  async #remove() {
    const { name } = this;
    const sure = this.removal;
    this.removal = !sure;
    this.#offer();
    if (!sure) return;
    const asked = deleteTexture(name, this.shown?.etag ?? "*");
    const done = await this.outcome.of(asked, `${name} is not deleted`);
    if (done !== null && name === this.name) this.tell.deleted();
    else this.tell.changed();
  }
}
