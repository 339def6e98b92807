/** What came of a calibration: the fit with its intervals, as tables and as a chart. */

import { colour } from "../canvas/colours.js";
import { element, say } from "../elements/element.js";
import { fill, table } from "../elements/table.js";
import uPlot from "../vendor/uplot.mjs";
import { Diagnostics } from "./diagnostics.js";
import { cutoffsOf, parametersOf } from "./fit.js";

const HEIGHT_PX = 220;

export class Result {
  /** @param {Element} root */
  constructor(root) {
    this.root = root;
    this.chart = new CutoffChart();
    this.cutoffs = table(
      "Cutoff at the speeds that were measured",
      ["Speed, mm/s", "Cutoff, Hz", "95 % interval, Hz", "Half of it"],
    );
    this.parameters = table("Parameters of the law", ["Parameter", "Value", "95 % interval"]);
    this.diagnostics = new Diagnostics();
    this.notes = element("ul");
    this.study = element("p", { class: "quiet study" });
    const fit = element("div", {}, this.cutoffs, this.parameters);
    root.append(
      element("h3", {}, "The fit"),
      element("div", { class: "columns" }, this.chart.root, fit),
      this.diagnostics.root,
      this.notes,
      this.study,
    );
    root.hidden = true;
  }

  /** @param {object|null} result a CalibrationResult; null: none yet */
  show(result) {
    this.root.hidden = result === null;
    if (result === null) return;
    const cutoffs = cutoffsOf(result.details.cutoff_hz ?? []);
    this.chart.show(cutoffs);
    fill(this.cutoffs, cutoffs.map(({ speed, value, low, high, half }) => {
      const interval = `${fixed(low, 0)} to ${fixed(high, 0)}`;
      return [String(speed), fixed(value, 0), interval, `${fixed(100 * half, 1)} %`];
    }));
    fill(this.parameters, parametersOf(result.model).map(({ label, value, half, digits }) => {
      const ends = half === null ? null : [value - half, value + half];
      const interval = ends?.map((end) => fixed(end, digits)).join(" to ") ?? "unknown";
      return [label, fixed(value, digits), interval];
    }));
    this.diagnostics.show(result);
    this.notes.replaceChildren(...result.notes.map((note) => element("li", {}, note)));
    say(this.study, `All trials, on the machine of the service: ${result.study}`);
  }

  redraw() {
    this.chart.redraw();
  }
}

class CutoffChart {
  constructor() {
    const title = "Cutoff in Hz over speed in mm/s; the band is its 95 % interval";
    this.place = element("div", { class: "chart", role: "img" });
    this.place.setAttribute("aria-label", `${title}; the table beside it has its values`);
    this.root = element("figure", {}, element("figcaption", {}, title), this.place);
    this.plot = new uPlot(options(), [[], [], [], []], this.place);
    new ResizeObserver(([{ contentRect }]) => {
      this.plot.setSize({ width: Math.floor(contentRect.width), height: HEIGHT_PX });
    }).observe(this.place);
  }

  show(cutoffs) {
    const of = (name) => cutoffs.map((one) => one[name]);
    this.plot.setData([of("speed"), of("low"), of("high"), of("value")]);
  }

  redraw() {
    this.plot.redraw();
  }
}

/** With so many decimals; what rounds to zero has no sign. */
function fixed(value, digits) {
  const text = value.toFixed(digits);
  return Number(text) === 0 ? text.replace("-", "") : text;
}

function options() {
  const axis = { stroke: () => colour("--quiet"), grid: { stroke: () => colour("--grid") } };
  const edge = { stroke: () => colour("--band"), width: 1, points: { show: false } };
  const ink = () => colour("--trace-1");
  const points = { show: true, size: 8, fill: ink };
  return {
    width: 400,
    height: HEIGHT_PX,
    legend: { show: false },
    cursor: { show: false },
    scales: {
      // By the data: a range made from the range of before would grow with every drawing.
      x: { time: false, range: ({ data: [speeds] }) => [0, 1.1 * (speeds.at(-1) ?? 1)] },
      y: { range: (_plot, _least, most) => [0, 1.1 * (most ?? 1)] },
    },
    axes: [{ ...axis, size: 28 }, { ...axis, size: 56 }],
    series: [{}, edge, edge, { stroke: ink, width: 3, points }],
    bands: [{ series: [2, 1], fill: () => colour("--band") }],
  };
}
