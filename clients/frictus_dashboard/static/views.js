/** The views beside the live one: made when they are first shown, and kept. */

import { address, ALONE, VIEWS } from "./address.js";
import { outcomeUnknown } from "./connection/api.js";
import { at, element } from "./elements/element.js";
import { keptOut } from "./rig/holder.js";

/** For so long a state is waited for that would tell what came of a request. */
const CHECK_MS = 10_000;

const MAKERS = {
  "live-model": () => import("./live_model/view.js"),
  textures: () => import("./textures/view.js"),
  calibrate: () => import("./calibrate/view.js"),
  experiment: () => import("./experiment/view.js"),
  models: () => import("./models/view.js"),
  discovery: () => import("./discovery/view.js"),
  participant: () => import("./participant/view.js"),
};

/**
 * What views get of the page. A view is a class `View` with
 * `constructor(into, page)`: into is its own empty section, kept while the page is open;
 * `open(rig, rest)`: it is shown, for a rig or null, with what stands behind that in the address
 * (an array of words); called again whenever the address or the rig changes;
 * `close()`: another view is shown: stop what is only needed on screen;
 * `hear(message)`: a message of the live connection (`status`, `scene`, `estimate`, `rigs`, …).
 */
export class Page {
  /** @param {import("./connection/link.js").Link} link @param {import("./live/view.js").Live} live */
  constructor(link, live) {
    this.link = link;
    this.live = live;
  }

  /** The shown rig's newest status, scene, model and finger; each null where unknown. */
  get state() {
    return this.live.state;
  }

  /** Whether the rig that the address names is not there, by a service that would see it. */
  get gone() {
    return this.live.gone;
  }

  /** Why this page may not change what the shown rig renders, in words; empty where it may. */
  get keptOut() {
    return keptOut(this.live.rig, this.state.status, this.link.welcome?.client ?? "");
  }

  /**
   * What a request answers; where that is unknown, what the rig's state tells of it.
   *
   * @template T
   * @param {Promise<T>} asked
   * @param {import("./elements/outcome.js").Outcome} outcome says meanwhile that it is not known
   * @param {string} rig
   * @param {(state: object) => T|null} told what a state tells; null: nothing yet
   * @returns {Promise<T>}
   */
  async settled(asked, outcome, rig, told) {
    try {
      return await asked;
    } catch (error) {
      if (!outcomeUnknown(error)) throw error;
      outcome.unknown(`Unknown whether ${rig} did it, checking…`);
      const found = await this.#until(rig, told);
      if (found === null) throw error;
      return found;
    }
  }

  #until(rig, told) {
    return new Promise((resolve) => {
      const end = (found) => {
        clearTimeout(timer);
        this.link.removeEventListener("message", look);
        resolve(found);
      };
      const look = () => {
        const found = this.live.rig === rig && this.live.alive ? told(this.state) : null;
        if (found !== null) end(found);
      };
      const timer = setTimeout(() => end(null), CHECK_MS);
      this.link.addEventListener("message", look);
      look();
    });
  }

  /** Whether the token has a scope: `read`, `render`, `calibrate`, `admin`. */
  can(scope) {
    return this.link.welcome?.scopes.includes(scope) ?? false;
  }
}

/** Shows one view at a time. */
export class Views {
  /** @param {Page} page */
  constructor(page) {
    this.page = page;
    this.name = "live";
    this.made = new Map();
    this.wanted = null;
  }

  /**
   * Show a view; the live one is the page's own.
   *
   * @param {string} name one of `VIEWS`
   * @param {string|null} rig
   * @param {string[]} rest
   */
  async show(name, rig, rest) {
    const wanted = (this.wanted = {});
    if (this.name !== name) this.made.get(this.name)?.close();
    this.name = name;
    document.body.dataset.view = name;
    this.page.live.reveal(name === "live");
    for (const each of Object.keys(MAKERS)) {
      const section = document.getElementById(`view-${each}`);
      if (section !== null) section.hidden = each !== name;
    }
    if (name === "live") return;
    if (!this.made.has(name)) {
      const { View } = await MAKERS[name]();
      if (!this.made.has(name)) this.made.set(name, new View(this.#section(name), this.page));
    }
    // A faster hand may have gone elsewhere meanwhile.
    if (wanted === this.wanted) this.made.get(name).open(rig, rest);
  }

  /** Pass a message of the live connection on to the view that is shown. */
  hear(message) {
    this.made.get(this.name)?.hear(message);
  }

  #section(name) {
    const made = element("section", { id: `view-${name}`, class: "view" });
    made.setAttribute("aria-label", VIEWS[name]);
    at("main").append(made);
    return made;
  }
}

/** Links to all views, for a rig. */
export function linksTo(current, rig) {
  return Object.entries(VIEWS).filter(([name]) => name !== ALONE).map(([name, title]) => {
    const anchor = element("a", { href: address(name, rig) }, title);
    if (name === current) anchor.setAttribute("aria-current", "page");
    return element("li", {}, anchor);
  });
}
