/** The textures of the library, as links; the chosen one stands in the address. */

import { address } from "../address.js";
import { request } from "../connection/api.js";
import { element, say } from "../elements/element.js";
import { labelled } from "../elements/fields.js";
import { Outcome } from "../elements/outcome.js";
import { Thumbnails } from "./thumbnails.js";

export class Library {
  /** @param {Element} into */
  constructor(into) {
    /** Summaries, sorted by name. */
    this.textures = [];
    this.loaded = false;
    this.rig = this.chosen = null;
    this.wanted = element("input", { type: "search", autocomplete: "off" });
    this.wanted.addEventListener("input", () => this.#draw());
    this.count = element("p", { class: "quiet" });
    this.outcome = new Outcome();
    this.list = element("ul", { class: "library" });
    this.thumbnails = new Thumbnails(this.list);
    const find = element("div", { class: "fields" }, labelled("Find by name", this.wanted));
    into.append(find, this.count, this.outcome.root, this.list);
  }

  /** Read the list anew; whether it could be read. */
  async load() {
    const asked = (this.asked = {});
    const still = () => asked === this.asked;
    const found = await this.outcome.of(readAll(), "The library cannot be read", still);
    if (found === null || !still()) return false;
    this.outcome.clear();
    this.textures = found;
    this.loaded = true;
    this.#draw();
    return true;
  }

  /** The summary of a name; null where there is none. */
  find(name) {
    return this.textures.find((texture) => texture.name === name) ?? null;
  }

  /**
   * Link to a rig's textures, and mark the chosen one.
   *
   * @param {string|null} rig
   * @param {string|null} chosen
   */
  show(rig, chosen) {
    this.rig = rig;
    this.chosen = chosen;
    this.#draw();
  }

  #draw() {
    const wanted = this.wanted.value.trim().toLowerCase();
    const shown = this.textures.filter(({ name }) => name.includes(wanted));
    const drawn = JSON.stringify([this.rig, shown]);
    if (drawn !== this.drawn) {
      this.drawn = drawn;
      const focused = this.list.contains(document.activeElement)
        ? document.activeElement.dataset.name
        : null;
      this.list.replaceChildren(...shown.map((texture) => this.#entry(texture)));
      if (focused !== null) this.#link(focused)?.focus();
    }
    const own = shown.filter(({ shipped }) => !shipped).length;
    const found = `${shown.length} ${shown.length === 1 ? "texture" : "textures"}, ${own} yours`;
    say(this.count, this.loaded ? found : "");
    this.#mark();
  }

  #entry(texture) {
    const { name, kind, shipped, damaged } = texture;
    const link = element("a", { href: address("textures", this.rig ?? "", name) }, name);
    link.dataset.name = name;
    const about = damaged ? "damaged" : shipped ? `${kind}, shipped` : kind;
    const kindOf = element("span", { class: "quiet" }, about);
    return element("li", {}, this.thumbnails.of(texture), link, kindOf);
  }

  #mark() {
    const link = this.#link(this.chosen);
    const before = this.list.querySelector("[aria-current]");
    if (link === before) return;
    before?.removeAttribute("aria-current");
    if (!link) return;
    link.setAttribute("aria-current", "true");
    // Into view within the list; the page stays where it is.
    const { offsetTop, offsetHeight } = link.parentElement;
    const { scrollTop, clientHeight } = this.list;
    const below = offsetTop + offsetHeight - clientHeight;
    this.list.scrollTop = Math.max(below, Math.min(scrollTop, offsetTop));
  }

  #link(name) {
    const links = [...this.list.querySelectorAll("a")];
    return links.find((link) => link.dataset.name === name) ?? null;
  }
}

/** All pages of the list. */
async function readAll() {
  const found = [];
  for (let after = ""; after !== null; ) {
    const page = await request("GET", `/textures?after=${encodeURIComponent(after)}`);
    found.push(...page.textures);
    after = page.next;
  }
  return found;
}
