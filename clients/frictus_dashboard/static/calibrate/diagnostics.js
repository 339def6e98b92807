/** Points measured over the fit, what it leaves of them, and how well unseen trials are met. */

import { colour, onSchemeChange } from "../canvas/colours.js";
import { element } from "../elements/element.js";
import { drawPoints } from "../canvas/measured_points.js";
import { FREQUENCIES_HZ } from "../models/law.js";
import { fill, scrolling, table } from "../elements/table.js";
import uPlot from "../vendor/uplot.mjs";
import { groupsOf, rowsOf, sentencesOf } from "./points.js";

const HEIGHT_PX = 260;
const TICKS_HZ = [10, 20, 50, 100, 200, 500, 1000, 2000];
const FROM_TO_HZ = [FREQUENCIES_HZ[0], FREQUENCIES_HZ.at(-1)];
const STEP_DB = 5;
const MOST_GROUPS = 3;
const COLUMNS = [
  "Where", "Trials", "Measured, N", "95 %, N", "Fit, N", "Left, dB", "Phase left, °",
];

export class Diagnostics {
  constructor() {
    this.groups = [];
    this.told = element("div");
    this.place = element("div", { class: "chart", role: "img" });
    this.place.setAttribute("aria-label", "Friction per full drive over frequency, measured and fitted; the table has its values");
    this.keys = element("ul", { class: "keys" });
    this.table = table("Every point that was measured", COLUMNS);
    const values = element("details", {}, element("summary", {}, "As a table"), scrolling(this.table));
    const caption = element("figcaption", {}, "Friction per full drive, dB re 1 N, over frequency");
    const figure = element("figure", {}, caption, this.place, this.keys, values);
    const title = element("h3", {}, "Does the law fit?");
    this.root = element("div", { class: "diagnostics" }, title, this.told, figure);
    this.chart = new uPlot(this.#options(), this.#data(), this.place);
    new ResizeObserver(([{ contentRect }]) => {
      const width = Math.floor(contentRect.width);
      if (width > 0) this.chart.setSize({ width, height: HEIGHT_PX });
    }).observe(this.place);
    onSchemeChange(() => this.chart.redraw());
  }

  /** @param {object} result a CalibrationResult; one of before has no diagnostics */
  show({ details: { diagnostics = null }, model }) {
    this.root.hidden = diagnostics === null;
    if (diagnostics === null) return;
    this.told.replaceChildren(
      ...sentencesOf(diagnostics).map((text) => element("p", {}, text)),
    );
    this.groups = groupsOf(diagnostics, model);
    this.chart.setData(this.#data());
    this.place.dataset.points = this.groups.reduce((sum, { points }) => sum + points.length, 0);
    this.keys.replaceChildren(...keysOf(this.groups));
    fill(this.table, rowsOf(diagnostics));
  }

  #data() {
    const none = FREQUENCIES_HZ.map(() => null);
    const fits = Array.from({ length: MOST_GROUPS }, (_, i) => this.groups[i]?.fit ?? none);
    return [FREQUENCIES_HZ, ...fits];
  }

  #options() {
    const axis = { stroke: () => colour("--quiet"), grid: { stroke: () => colour("--grid") } };
    const named = (hz) => (hz < 1_000 ? String(hz) : `${hz / 1_000} k`);
    const line = (_, i) => ({
      width: 2,
      stroke: () => colour(this.groups[i]?.ink ?? "--quiet"),
      points: { show: false },
    });
    return {
      width: 400,
      height: HEIGHT_PX,
      padding: [8, 12, 0, 0],
      legend: { show: false },
      cursor: { show: false },
      scales: {
        x: { time: false, distr: 3, range: FROM_TO_HZ },
        y: { range: () => this.#range() },
      },
      axes: [
        { ...axis, splits: () => TICKS_HZ, values: () => TICKS_HZ.map(named), size: 28 },
        { ...axis, size: 46, space: 28 },
      ],
      series: [{}, ...Array.from({ length: MOST_GROUPS }, line)],
      hooks: { draw: [(chart) => drawPoints(chart, this.groups)] },
    };
  }

  #range() {
    const levels = this.groups.flatMap(({ points }) => points.flatMap(({ low, high }) => [low, high]));
    if (levels.length === 0) return [-20, 0];
    return [
      STEP_DB * Math.floor(Math.min(...levels) / STEP_DB),
      STEP_DB * Math.ceil(Math.max(...levels) / STEP_DB),
    ];
  }
}

function keysOf(groups) {
  const measured = groups.map(({ ink, sign, speedMmS }) => {
    const made = element("li", {}, `${sign} ${speedMmS} mm/s`);
    made.style.setProperty("color", `var(${ink})`);
    return made;
  });
  return [...measured, element("li", {}, "┼ measured, 95 %; the line is the fit")];
}
