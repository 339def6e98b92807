/** In a detail that opens: windows used and refused, and the values of the figures as tables. */

import { element, say } from "../elements/element.js";
import { fill, scrolling, table, words } from "../elements/table.js";

const POINTS = ["Hz", "Speed, mm/s", "Level, dB re 1 N", "± dB (95 %)", "Phase, °"];
const LAW = ["Parameter", "Value", "From", "To", "In force"];
const PARAMETERS = {
  gain_n: ["Gain, N", 3],
  cutoff_20_hz: ["Cutoff at 20 mm/s, Hz", 0],
  cutoff_100_hz: ["Cutoff at 100 mm/s, Hz", 0],
  delay_us: ["Delay, µs", 1],
};

export class Tables {
  constructor() {
    this.state = null;
    this.summary = element("summary");
    this.windows = table("Windows of 0.1 s that could not be used", ["Reason", "Windows"]);
    this.points = table("Measured, last 10 s of sliding", POINTS);
    this.law = table("Learned, with 95 % intervals", LAW);
    const left = element("div", {}, scrolling(this.windows), scrolling(this.law));
    const right = element("div", {}, scrolling(this.points));
    const columns = element("div", { class: "columns" }, left, right);
    this.root = element("details", { class: "tables" }, this.summary, columns);
    this.root.addEventListener("toggle", () => this.#fill());
  }

  /** @param {object} state of `viewStateOf` */
  show(state) {
    this.state = state;
    const { estimate, refused } = state;
    if (estimate === null) return;
    const left = refused.reduce((sum, [, count]) => sum + count, 0);
    say(this.summary, `${estimate.windows} windows used, ${left} refused: reasons, and all values`);
    this.#fill();
  }

  /** Renew the tables, while anybody can see them. */
  #fill() {
    if (!this.root.open || (this.state?.estimate ?? null) === null) return;
    const { estimate, refused, groups } = this.state;
    fill(this.windows, refused.map(([reason, count]) => [words(reason), String(count)]));
    fill(this.points, (groups ?? []).flatMap((group) => group?.points.map(pointRow) ?? []));
    const { law, in_force: inForce } = estimate;
    fill(this.law, law === null ? [] : Object.keys(PARAMETERS).map((name) => {
      return parameterRow(name, law[name], inForce?.[name]);
    }));
  }
}

function pointRow({ hz, speedMmS, db, half, deg }) {
  return [hz.toFixed(0), speedMmS.toFixed(0), db.toFixed(2), half.toFixed(2), deg.toFixed(0)];
}

function parameterRow(name, { value, low, high }, inForce) {
  const [title, digits] = PARAMETERS[name];
  const numbers = [value, low, high].map((each) => each.toFixed(digits));
  return [title, ...numbers, inForce?.toFixed(digits) ?? "–"];
}
