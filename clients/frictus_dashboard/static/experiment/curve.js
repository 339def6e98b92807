/** The psychometric function of a condition: answers by level, the fit over them. */

import { colour, onSchemeChange } from "../canvas/colours.js";
import { element, say } from "../elements/element.js";
import { figure } from "../elements/figures.js";
import { fill, table } from "../elements/table.js";
import uPlot from "../vendor/uplot.mjs";

const HEIGHT_PX = 220;
const HEAD = ["Level", "Trials", "Positive", "Share, %"];

export class Curve {
  /** @param {string} name of the condition */
  constructor(name) {
    this.name = name;
    this.title = element("h3", {}, name);
    this.threshold = element("p", { class: "summary" });
    this.lines = element("ul");
    this.place = element("div", { class: "chart", role: "img" });
    this.place.setAttribute("aria-label", `Answers of ${name} over level; the table has the values`);
    this.table = table("Answers by level", HEAD);
    this.told = element("details", {}, element("summary", {}, "As a table"), this.table);
    this.root = element("figure", {}, this.title, this.threshold, this.place, this.lines, this.told);
    this.chart = null;
    new ResizeObserver(() => this.#fit()).observe(this.place);
    onSchemeChange(() => this.chart?.redraw());
  }

  /** @param {object} report what the service says of the condition */
  show({ threshold, unit, lines, trials, points, curve }) {
    const span = threshold && `${figure(threshold.low, 3)} to ${figure(threshold.high, 3)}`;
    const words = threshold && `Threshold ${figure(threshold.value, 3)} ${unit} (95 %: ${span})`;
    say(this.threshold, words ?? `${trials} trials, no threshold yet`);
    this.lines.replaceChildren(...lines.map((line) => element("li", {}, line.trim())));
    this.place.hidden = this.told.hidden = points.length === 0;
    fill(this.table, points.map((point) => {
      const share = figure((100 * point.positive) / point.trials, 3);
      return [figure(point.level, 3), String(point.trials), String(point.positive), share];
    }));
    this.#draw(unit, points, curve);
  }

  #draw(unit, points, curve) {
    const at = new Map(points.map(({ level, trials, positive }) => [level, positive / trials]));
    const fitted = new Map(curve);
    const levels = [...new Set([...at.keys(), ...fitted.keys()])].sort((a, b) => a - b);
    const of = (found) => levels.map((level) => found.get(level) ?? null);
    const data = [levels, of(fitted), of(at)];
    if (levels.length === 0) return;
    this.chart?.destroy();
    this.chart = new uPlot(options(unit), data, this.place);
    this.#fit();
  }

  #fit() {
    const width = Math.floor(this.place.clientWidth);
    if (width > 0) this.chart?.setSize({ width, height: HEIGHT_PX });
  }
}

function options(unit) {
  const axis = { stroke: () => colour("--quiet"), grid: { stroke: () => colour("--grid") } };
  const named = (_, ticks) => ticks.map((tick) => (tick === null ? "" : figure(tick, 3)));
  return {
    width: 400,
    height: HEIGHT_PX,
    legend: { show: false },
    cursor: { show: false },
    scales: { x: { time: false, distr: 3 }, y: { range: [0, 1] } },
    axes: [
      { ...axis, label: `Level, ${unit}`, values: named, size: 28, labelSize: 24 },
      { ...axis, size: 48 },
    ],
    series: [
      {},
      { stroke: () => colour("--trace-1"), width: 3, spanGaps: true, points: { show: false } },
      {
        stroke: () => colour("--trace-2"),
        paths: () => null,
        points: { show: true, size: 9, fill: () => colour("--trace-2") },
      },
    ],
  };
}
