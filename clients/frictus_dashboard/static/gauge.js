/** One quantity as a large number, against the range in which the model is valid. */

import { element, say } from "./element.js";

/** Number, mark and verdict change together, no faster than can be read. */
const READ_MS = 250;

export class Gauge {
  /**
   * @param {Element} root
   * @param {{name: string, unit: string, digits: number, least: number}} what
   *   `least`: the scale reaches at least so far
   */
  constructor(root, what) {
    this.what = what;
    this.range = null;
    this.number = element("span", { class: "number" }, "–");
    this.words = element("p", { class: "words" });
    this.zone = element("div", { class: "zone" });
    this.mark = element("div", { class: "mark" });
    this.toldMs = -Infinity;
    this.touched = false;
    root.append(
      element("p", { class: "reading" }, `${what.name} `, this.number, ` ${what.unit}`),
      element("div", { class: "bar", "aria-hidden": "true" }, this.zone, this.mark),
      this.words,
    );
    this.root = root;
  }

  /** @param {[number, number]|null} range within which the model is valid; null: not known */
  setRange(range) {
    this.range = range;
    this.zone.hidden = range === null;
    if (range === null) return;
    this.#place(this.zone, "--from", range[0]);
    this.#place(this.zone, "--to", range[1]);
  }

  /** @param {number|null} value null: the finger does not touch */
  show(value, nowMs) {
    const touches = value !== null;
    if (nowMs - this.toldMs < READ_MS && touches === this.touched) return;
    this.toldMs = nowMs;
    this.touched = touches;
    const { digits } = this.what;
    const inside = this.#judge(value);
    this.mark.hidden = !touches;
    if (touches) this.#place(this.mark, "--at", value);
    this.root.dataset.inside = inside;
    say(this.number, touches ? value.toFixed(digits) : "–");
    say(this.words, this.#sentence(inside));
  }

  /** Whether one value was measured: nobody knows how far from it the model still holds. */
  get #single() {
    return this.range[0] === this.range[1];
  }

  #judge(value) {
    if (value === null) return "none";
    if (this.range === null || this.#single) return "unknown";
    if (value < this.range[0]) return "below";
    return value > this.range[1] ? "above" : "inside";
  }

  #sentence(inside) {
    if (this.range === null) return "Valid range not known yet";
    const { unit } = this.what;
    if (this.#single) return `Measured at ${this.range[0]} ${unit} only`;
    const range = `${this.range[0]} to ${this.range[1]} ${unit}`;
    if (inside === "none") return `No contact; valid: ${range}`;
    return inside === "inside" ? `✓ Valid: ${range}` : `▲ ${inside} the valid ${range}`;
  }

  #place(part, property, value) {
    const full = Math.max(this.what.least, this.range === null ? 0 : 1.5 * this.range[1]);
    const share = Math.min(1, Math.max(0, value / full));
    part.style.setProperty(property, `${(100 * share).toFixed(2)}%`);
  }
}
