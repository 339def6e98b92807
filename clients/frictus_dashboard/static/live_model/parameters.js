/** Gain, cutoffs and delay over the last minutes with intervals, beside the model in force. */

import { colour, onSchemeChange } from "../canvas/colours.js";
import { element, say } from "../elements/element.js";
import uPlot from "../vendor/uplot.mjs";
import { axisSpanS, columnsOf, marksOf, rangeOf } from "./history.js";

const HEIGHT_PX = 88;
const BAND_ALPHA = "38";
const SHOWN = [
  { name: "gain_n", title: "Gain", unit: "N", digits: 3 },
  { name: "delay_us", title: "Force sensor's delay", unit: "µs", digits: 1 },
  { name: "cutoff_20_hz", title: "Cutoff at 20 mm/s", unit: "Hz", digits: 0 },
  { name: "cutoff_100_hz", title: "Cutoff at 100 mm/s", unit: "Hz", digits: 0 },
];

class Parameter {
  constructor(shown) {
    this.shown = shown;
    this.columns = columnsOf([], shown.name, 0);
    this.marks = [];
    this.spanS = 60;
    this.value = element("b");
    this.words = element("span");
    this.place = element("div", { class: "chart", role: "img" });
    this.place.setAttribute("aria-label", `${shown.title} over the last minutes`);
    this.place.setAttribute("aria-describedby", `${shown.name}-values`);
    const told = element("p", { id: `${shown.name}-values`, class: "quiet" }, this.words);
    const title = element("h3", {}, shown.title, this.value);
    this.root = element("figure", { "data-parameter": shown.name }, title, told, this.place);
    this.chart = new uPlot(this.#options(), this.columns, this.place);
    new ResizeObserver(([{ contentRect }]) => {
      const width = Math.floor(contentRect.width);
      if (width > 0) this.chart.setSize({ width, height: HEIGHT_PX });
    }).observe(this.place);
    onSchemeChange(() => this.chart.redraw());
  }

  show({ estimate, entries }) {
    const { name, unit, digits } = this.shown;
    const law = estimate?.law ?? null;
    const nowS = (estimate?.utc_ns ?? 0) / 1e9;
    this.columns = columnsOf(entries, name, nowS);
    this.marks = marksOf(estimate, entries, nowS);
    this.spanS = axisSpanS(entries, nowS);
    this.place.dataset.entries = entries.length;
    this.place.dataset.marks = this.marks.length;
    this.chart.setData(this.columns);
    if (law === null) {
      say(this.value, "–");
      say(this.words, "");
      return; // the view shows no charts then
    }
    const { value, low, high } = law[name];
    const inForce = estimate.in_force?.[name];
    const model = inForce === undefined ? "" : `; in force ${inForce.toFixed(digits)}`;
    say(this.value, `${value.toFixed(digits)} ${unit}`);
    say(this.words, `${low.toFixed(digits)} to ${high.toFixed(digits)}${model}`);
  }

  #options() {
    const axis = { stroke: () => colour("--quiet"), grid: { stroke: () => colour("--grid") } };
    const hidden = { width: 0, stroke: "transparent", points: { show: false } };
    const told = (s) => (this.spanS > 60 ? `${(s / 60).toFixed(s % 60 ? 1 : 0)} min` : `${s} s`);
    return {
      width: 200,
      height: HEIGHT_PX,
      padding: [8, 12, 0, 0],
      legend: { show: false },
      cursor: { show: false },
      scales: {
        x: { time: false, range: () => [-this.spanS, 0] },
        y: { range: () => rangeOf(this.columns) },
      },
      axes: [
        {
          ...axis,
          size: 24,
          splits: () => [-this.spanS, -this.spanS / 2, 0],
          values: (_, at) => at.map((s) => (s === 0 ? "now" : told(s))),
        },
        { ...axis, size: 50, space: 18 },
      ],
      series: [
        {},
        hidden,
        hidden,
        { width: 2, stroke: () => colour("--trace-1"), points: { show: false } },
        { width: 2, dash: [6, 4], stroke: () => colour("--trace-2"), points: { show: false } },
      ],
      bands: [{ series: [1, 2], fill: () => `${colour("--trace-1")}${BAND_ALPHA}` }],
      hooks: { draw: [(chart) => this.#drawMarks(chart)] },
    };
  }

  #drawMarks(chart) {
    const { ctx, bbox } = chart;
    ctx.save();
    ctx.setLineDash([]); // that of the last line holds still
    ctx.strokeStyle = ctx.fillStyle = colour("--ink");
    ctx.lineWidth = devicePixelRatio;
    for (const s of this.marks) {
      const x = chart.valToPos(s, "x", true);
      const size = 5 * devicePixelRatio;
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
      ctx.stroke();
      ctx.beginPath();
      ctx.moveTo(x - size, bbox.top);
      ctx.lineTo(x + size, bbox.top);
      ctx.lineTo(x, bbox.top + size);
      ctx.fill();
    }
    ctx.restore();
  }
}

export class Parameters {
  constructor() {
    this.parts = SHOWN.map((shown) => new Parameter(shown));
    const key = (look, ink) => {
      const made = element("span", { class: look, "aria-hidden": "true" });
      made.style.setProperty("--key", `var(${ink})`);
      return made;
    };
    const keys = element(
      "ul",
      { class: "keys" },
      element("li", {}, key("key", "--trace-1"), "learned, band 95 %"),
      element("li", {}, key("key broken", "--trace-2"), "model in force"),
      element("li", {}, "▼ model changed"),
    );
    const grid = element("div", { class: "parameters" }, ...this.parts.map(({ root }) => root));
    this.root = element("div", {}, grid, keys);
  }

  /** @param {object} state of `viewStateOf` */
  show(state) {
    for (const part of this.parts) part.show(state);
  }
}
