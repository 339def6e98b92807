/** The versions of a name and the aliases that stand for them; who may moves them. */

import { request, send } from "../connection/api.js";
import { element } from "../elements/element.js";
import { labelled } from "../elements/fields.js";
import { moment } from "../elements/figures.js";
import { Outcome } from "../elements/outcome.js";
import { fill, scrolling, table, words } from "../elements/table.js";
import { pathOf, referenceOf } from "./reference.js";

const PAGE = 100;
const HEAD = ["Version", "Aliases", "Published", "Comment", "Compare"];

export class Aliases {
  /**
   * @param {import("../views.js").Page} page
   * @param {{addressOf: (...references: string[]) => string, moved: () => void}} does
   */
  constructor(page, { addressOf, moved }) {
    this.page = page;
    this.addressOf = addressOf;
    this.moved = moved;
    this.version = null;
    /** By name, as they were when they were shown: `{version, etag}`. */
    this.standing = new Map();
    this.table = table("Versions and aliases of this name", HEAD);
    this.alias = element("input", { type: "text", required: "", value: "production" });
    this.alias.setAttribute("pattern", "[a-z][a-z0-9_\\-]{0,31}");
    this.reason = element("input", { type: "text", maxlength: "1000" });
    this.button = element("button", { type: "submit" });
    this.form = element(
      "form",
      { class: "fields" },
      labelled("Alias", this.alias),
      labelled("Reason", this.reason),
      this.button,
    );
    this.form.addEventListener("submit", (event) => (event.preventDefault(), this.#move()));
    this.outcome = new Outcome();
    const title = element("h3", {}, "Versions and aliases");
    this.root = element("div", {}, title, scrolling(this.table, true), this.form, this.outcome.root);
  }

  /** @param {object} version the published one that is shown */
  async open(version) {
    const before = this.version === null ? null : referenceOf(this.version);
    if (referenceOf(version) !== before) this.outcome.clear();
    this.version = version;
    this.form.hidden = !this.page.can("admin");
    this.button.textContent = `Let it stand for version ${version.version}`;
    const wanted = (this.wanted = {});
    const found = await this.outcome.of(this.#read(version.name), "Not read");
    if (found === null || wanted !== this.wanted) return;
    this.standing = found.standing;
    this.#draw(found.page);
  }

  async #read(name) {
    const asked = new URLSearchParams({ name, limit: PAGE });
    const [page, { aliases }] = await Promise.all([
      request("GET", `/models?${asked}`),
      request("GET", `${pathOf(name)}/aliases`),
    ]);
    const standing = await Promise.all(aliases.map(async ({ alias }) => {
      const answer = await send("GET", `${pathOf(name)}/aliases/${alias}`);
      const { version } = await answer.json();
      return [alias, { version, etag: answer.headers.get("ETag") }];
    }));
    return { page, standing: new Map(standing) };
  }

  #draw({ models, next }) {
    const shown = referenceOf(this.version);
    const rows = models.map((each) => {
      const reference = referenceOf(each);
      const link = element("a", { href: this.addressOf(reference) }, String(each.version));
      if (reference === shown) link.setAttribute("aria-current", "true");
      const aliases = [...this.standing].filter(([, { version }]) => version === each.version);
      const both = this.addressOf(shown, reference);
      const beside = element("a", { href: both }, `with ${reference}`);
      return [
        link,
        words(aliases.map(([alias]) => alias).join(", ")),
        moment(each.published_utc_ns),
        words(each.comment),
        words(reference === shown ? "" : beside),
      ];
    });
    fill(this.table, next === null ? rows : [...rows, ["older ones are not listed"]]);
  }

  async #move() {
    const { name, version } = this.version;
    const alias = this.alias.value;
    const seen = this.standing.get(alias);
    const headers = seen ? { "If-Match": seen.etag } : { "If-None-Match": "*" };
    const json = { version, reason: this.reason.value };
    const asked = request("PUT", `${pathOf(name)}/aliases/${alias}`, { json, headers });
    const moved = await this.outcome.of(asked, "Not moved");
    if (moved !== null) {
      this.reason.value = "";
      const from = seen ? `, before for version ${seen.version}` : "";
      this.outcome.good(`${name}@${alias} stands for version ${moved.version}${from}.`);
      this.moved();
    }
    await this.open(this.version); // another hand may have moved it: where it stands now
  }
}
