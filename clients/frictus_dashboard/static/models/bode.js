/** Bode plots of one or two models at chosen speeds, in the same figures and as tables. */

import { colour, onSchemeChange } from "../canvas/colours.js";
import { element } from "../elements/element.js";
import { figure } from "../elements/figures.js";
import { scrolling, table } from "../elements/table.js";
import uPlot from "../vendor/uplot.mjs";
import { cutoffHz, FREQUENCIES_HZ, heldSpeed, response, UNITS } from "./law.js";

const HEIGHT_PX = 220;
const INKS = ["--trace-1", "--trace-2", "--trace-3"];
/** A model's line: the first is drawn through, the second broken. */
const STYLES = [
  { width: 3, dash: [] },
  { width: 2, dash: [9, 5] },
];
const TICKS_HZ = [10, 20, 50, 100, 200, 500, 1000, 2000];
const TABLE_HZ = [31.5, 63, 125, 250, 500, 1000, 2000];
/** As many as there are colours. */
export const MOST_SPEEDS = INKS.length;

export class Bode {
  constructor() {
    this.charts = [];
    this.places = ["Level", "Phase"].map((title) => {
      const place = element("div", { class: "chart", role: "img" });
      place.setAttribute("aria-label", `${title} over frequency; the tables have its values`);
      return place;
    });
    this.level = element("h3");
    this.keys = element("ul", { class: "keys" });
    this.tables = element("div", { class: "columns" });
    const both = [
      element("div", {}, this.level, this.places[0]),
      element("div", {}, element("h3", {}, "Phase, degrees"), this.places[1]),
    ];
    const charts = element("div", { class: "columns" }, ...both);
    const told = element("details", {}, element("summary", {}, "As tables"), this.tables);
    this.root = element("figure", {}, charts, this.keys, told);
    new ResizeObserver(() => this.#fit()).observe(this.places[0]);
    onSchemeChange(() => this.charts.forEach((chart) => chart.redraw()));
  }

  /**
   * @param {{name: string, model: object}[]} models one or two, of the same response
   * @param {number[]} speedsMmS at most `MOST_SPEEDS`
   */
  show(models, speedsMmS) {
    this.level.textContent = `Level, dB re ${UNITS[models[0].model.base.law]}`;
    const lines = speedsMmS.flatMap((speed, i) => models.map(({ name, model }, k) => {
      const points = FREQUENCIES_HZ.map((hz) => response(model, hz, speed));
      return { name, model, speed, points, ink: INKS[i], ...STYLES[k] };
    }));
    this.charts.forEach((chart) => chart.destroy());
    this.charts = ["db", "deg"].map((part, i) => {
      const data = [FREQUENCIES_HZ, ...lines.map(({ points }) => points.map((at) => at[part]))];
      return new uPlot(options(lines), data, this.places[i]);
    });
    this.#fit();
    this.keys.replaceChildren(...lines.map(key));
    this.tables.replaceChildren(...speedsMmS.map((speed) => values(models, speed)));
  }

  #fit() {
    this.charts.forEach((chart, i) => {
      const width = Math.floor(this.places[i].clientWidth);
      if (width > 0) chart.setSize({ width, height: HEIGHT_PX });
    });
  }
}

function key({ name, model, speed, ink, dash }) {
  const look = dash.length > 0 ? "key broken" : "key";
  const mark = element("span", { class: look, "aria-hidden": "true" });
  mark.style.setProperty("--key", `var(${ink})`);
  return element("li", {}, mark, `${name} ${at(model, speed)}`);
}

/** In words, at which speed a line is drawn and where its cutoff lies. */
function at(model, speed) {
  const cutoff = cutoffHz(model, speed);
  if (cutoff === null) return "at any speed";
  const held = heldSpeed(model, speed);
  const beyond = held === speed ? "" : `, as at ${held} mm/s, the end of what was measured`;
  return `at ${speed} mm/s: cutoff ${figure(cutoff)} Hz${beyond}`;
}

function values(models, speed) {
  const names = models.map(({ name }) => name);
  const [levels, phases] = ["dB", "°"].map((unit) => names.map((name) => `${name}, ${unit}`));
  const rows = TABLE_HZ.map((hz) => {
    const found = models.map(({ model }) => response(model, hz, speed));
    const db = found.map((at) => at.db.toFixed(2));
    return [String(hz), ...db, ...found.map((at) => at.deg.toFixed(1))];
  });
  return scrolling(table(`At ${speed} mm/s`, ["Hz", ...levels, ...phases], rows));
}

function options(lines) {
  const axis = { stroke: () => colour("--quiet"), grid: { stroke: () => colour("--grid") } };
  const named = (hz) => (hz < 1_000 ? String(hz) : `${hz / 1_000} kHz`);
  return {
    width: 400,
    height: HEIGHT_PX,
    legend: { show: false },
    cursor: { show: false },
    scales: { x: { time: false, distr: 3, range: [10, 2_000] } },
    axes: [
      { ...axis, splits: () => TICKS_HZ, values: () => TICKS_HZ.map(named), size: 28 },
      { ...axis, size: 56, space: 24 },
    ],
    series: [
      {},
      ...lines.map(({ name, ink, width, dash }) => ({
        label: name,
        width,
        dash,
        stroke: () => colour(ink),
        points: { show: false },
      })),
    ],
  };
}
