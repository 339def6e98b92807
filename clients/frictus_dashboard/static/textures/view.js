/** Textures: the library, what they would be like, making them, and where they are felt. */

import { address } from "../address.js";
import { element } from "../elements/element.js";
import { button } from "../elements/fields.js";
import { Chosen } from "./chosen.js";
import { Comparison } from "./comparison.js";
import { Editor } from "./editor.js";
import { Library } from "./library.js";
import { Recording } from "./recording.js";
import { Regions } from "./regions.js";

/** A rig that falls silent says nothing by which it could be noticed. */
const LOOK_MS = 500;

/** The address names what is shown: `#/textures/RIG/TEXTURE`. */
export class View {
  /** @param {HTMLElement} into @param {import("../views.js").Page} page */
  constructor(into, page) {
    this.page = page;
    this.rig = this.name = null;
    /** Ends what goes on while the view is shown; null: it is not. */
    this.shown = null;
    const listed = part("Library");
    this.library = new Library(listed);
    this.begin = button("New texture", () => this.editor.fresh());
    listed.append(element("p", {}, this.begin));
    this.recorded = part("A recording becomes a texture");
    this.recording = new Recording(this.recorded, {
      drafted: (texture) => this.chosen.draft(texture),
      saved: (name) => this.#made(name),
    });
    const edited = element("section", { "aria-label": "Editor" });
    this.editor = new Editor(edited, {
      drafted: (texture) => this.chosen.draft(texture),
      closed: () => this.chosen.read(),
      saved: (name) => this.#made(name),
    });
    const previewed = element("section", { "aria-label": "Preview" });
    this.chosen = new Chosen(previewed, page, {
      edit: (name, texture, etag) => this.editor.edit(name, texture, etag),
      deleted: () => this.#deleted(),
      changed: () => this.#load(),
    });
    const compared = part("A against B");
    this.comparison = new Comparison(compared, page);
    const placed = part("Scene: which texture is felt where");
    this.regions = new Regions(placed, page);
    const making = element("div", {}, listed, this.recorded, edited);
    into.append(
      element("div", { class: "panels" }, making, element("div", {}, previewed, compared)),
      placed,
    );
  }

  open(rig, rest) {
    const again = this.name === (rest[0] ?? this.name);
    this.rig = rig;
    this.name = rest[0] ?? this.name;
    const may = this.page.can("render");
    this.recorded.hidden = this.begin.hidden = !may;
    if (!may) this.editor.close();
    this.close();
    this.shown = new AbortController();
    if (may) this.recording.listen(this.shown.signal);
    this.looking = setInterval(() => this.regions.look(), LOOK_MS);
    this.#show();
    // It is opened again when the service is there.
    if (this.page.link.state === "open" && (again || !this.library.loaded)) this.#load();
  }

  close() {
    this.shown?.abort();
    this.shown = null;
    for (const { sound } of [this.chosen.preview, this.recording.trim]) sound.stop();
    clearInterval(this.looking);
  }

  hear(message) {
    if (message.rig !== this.rig) return;
    if (message.op === "model") this.chosen.renew();
    if (message.op === "status") this.chosen.hear();
    if (!["status", "scene", "lost"].includes(message.op)) return;
    this.regions.hear();
    this.comparison.hear();
  }

  #show() {
    this.library.show(this.rig, this.name);
    this.chosen.open(this.rig, this.name, this.library.find(this.name));
    const whole = this.library.textures.filter(({ damaged }) => !damaged);
    const names = whole.map(({ name }) => name);
    this.regions.open(this.rig, names, this.name);
    this.comparison.open(this.rig, names, this.name);
  }

  async #load() {
    if (await this.library.load()) this.#show();
  }

  /** A texture has come into the library, or is another. */
  async #made(name) {
    const again = name === this.name;
    if (again) this.chosen.read();
    await this.#load();
    if (!again) this.#choose(name);
  }

  async #deleted() {
    this.#choose(null);
    await this.#load();
    if (this.shown !== null) this.begin.focus(); // its own button is gone
  }

  #choose(name) {
    this.name = name;
    const rest = name === null ? [] : [name];
    // Whoever has gone to another view meanwhile finds it when they come back.
    if (this.shown !== null) location.hash = address("textures", this.rig ?? "", ...rest);
  }
}

function part(title) {
  return element("section", { "aria-label": title }, element("h2", {}, title));
}
