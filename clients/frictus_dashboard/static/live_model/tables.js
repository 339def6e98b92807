/** In a detail that opens: windows used and refused, and the values of the figures as tables. */

import { element, say } from "../element.js";
import { scrolling, fill, table, words } from "../table.js";

export class Tables {
  constructor() {
    this.summary = element("summary");
    this.windows = table("Windows of 0.1 s that could not be used", ["Reason", "Windows"]);
    this.points = table("Measured, last 10 s of sliding", [
      "Hz", "Speed, mm/s", "Level, dB re 1 N", "± dB (95 %)", "Phase, °",
    ]);
    this.law = table("Learned, with 95 % intervals", ["Parameter", "Value", "From", "To", "In force"]);
    const tables = [this.windows, this.law].map((each) => element("div", {}, scrolling(each)));
    const columns = element("div", { class: "columns" }, element("div", {}, ...tables),
      element("div", {}, scrolling(this.points)));
    this.root = element("details", { class: "tables" }, this.summary, columns);
    this.root.addEventListener("toggle", () => this.state && this.show(this.state));
  }

  /** @param {object} state of `viewStateOf` */
  show(state) {
    this.state = state;
    const { estimate, refused = [], groups } = state;
    if (estimate === null) return;
    const left = refused.reduce((sum, [, count]) => sum + count, 0);
    say(this.summary, `${estimate.windows} windows used, ${left} refused: reasons, and all values`);
    if (!this.root.open) return; // twice a second, for nobody
    fill(this.windows, refused.map(([reason, count]) => [words(reason), String(count)]));
    const points = (groups ?? []).flatMap((group) => group?.points.map((point) => [group, point]) ?? []);
    fill(this.points, points.map(([group, { hz, db, half, deg }]) => [
      hz.toFixed(0), group.speedMmS.toFixed(0), db.toFixed(2), half.toFixed(2), deg.toFixed(0),
    ]));
    fill(this.law, Object.entries(NAMES).flatMap(([name, [title, digits]]) => {
      const told = estimate.law?.[name];
      if (told === undefined) return [];
      const inForce = estimate.in_force?.[name]?.toFixed(digits) ?? "–";
      return [[title, ...[told.value, told.low, told.high].map((each) => each.toFixed(digits)), inForce]];
    }));
  }
}

const NAMES = {
  gain_n: ["Gain, N", 3],
  cutoff_20_hz: ["Cutoff at 20 mm/s, Hz", 0],
  cutoff_100_hz: ["Cutoff at 100 mm/s, Hz", 0],
  delay_us: ["Delay, µs", 1],
};
