/** One line over one axis, its values in words and as a table. */

import { colour, onSchemeChange } from "../canvas/colours.js";
import { element, say } from "../elements/element.js";
import { fill, table } from "../elements/table.js";
import uPlot from "../vendor/uplot.mjs";

const HEIGHT_PX = 150;

/** @typedef {{name: string, digits: number}} Axis */

export class Plot {
  /**
   * @param {Element} into
   * @param {{x: Axis, y: Axis, scales: object, axes: object[], points: boolean}} what
   *   `scales` and `axes` as uPlot takes them
   */
  constructor(into, what) {
    this.what = what;
    this.title = element("h3");
    this.summary = element("p", { class: "quiet" });
    this.place = element("div", { class: "chart", role: "img" });
    this.table = table("The values drawn", [what.x.name, what.y.name]);
    const values = element("details", {}, element("summary", {}, "As a table"), this.table);
    this.root = element("figure", {}, this.title, this.place, this.summary, values);
    into.append(this.root);
    this.chart = new uPlot(options(what), [[], []], this.place);
    new ResizeObserver(([{ contentRect }]) => {
      const width = Math.floor(contentRect.width);
      if (width > 0) this.chart.setSize({ width, height: HEIGHT_PX });
    }).observe(this.place);
    onSchemeChange(() => this.chart.redraw());
  }

  /**
   * @param {string} title
   * @param {string} summary
   * @param {number[]} x
   * @param {Array<number|null>} y null: there is nothing
   * @param {number} every how many are drawn for one that is told in the table
   */
  show(title, summary, x, y, every = 1) {
    say(this.title, title);
    say(this.summary, summary);
    this.place.setAttribute("aria-label", `${title}: ${summary}; the table has its values`);
    this.chart.setData([x, y]);
    const told = y.map((_, i) => i).filter((i) => i % every === 0);
    const digits = this.what.y.digits;
    const rows = told.map((i) => [x[i].toFixed(this.what.x.digits), shown(y[i], digits)]);
    fill(this.table, rows);
  }
}

function shown(value, digits) {
  return value === null ? "–" : value.toFixed(digits);
}

function options({ scales, axes, points }) {
  const plain = { stroke: () => colour("--quiet"), grid: { stroke: () => colour("--grid") } };
  const ink = () => colour("--trace-1");
  return {
    width: 400,
    height: HEIGHT_PX,
    legend: { show: false },
    cursor: { show: false },
    scales,
    axes: axes.map((axis) => ({ ...plain, ...axis })),
    series: [{}, { stroke: ink, width: 2, points: { show: points, size: 7, fill: ink } }],
  };
}
