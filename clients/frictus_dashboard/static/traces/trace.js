/** One stream over time: a chart of its history, and its values in words. */

import { colour } from "../canvas/colours.js";
import { element, say } from "../elements/element.js";
import { envelope } from "../canvas/envelope.js";
import { History } from "./history.js";
import { KEPT_S } from "./time_axis.js";
import uPlot from "../vendor/uplot.mjs";

/** Most columns that are drawn, and how long is asked of the service that they are. */
export const COLUMNS = 500;
export const COLUMN_S = 0.004;
const HEIGHT_PX = 108;
const INKS = ["--trace-1", "--trace-2", "--trace-3"];
const MARKS = { bad: "--bad", warn: "--warn" };
/** Room to the right for the names of the lines, and the least between two of them. */
const NAMES_PX = 14;
const APART_PX = 11;
/** The end of a line, by which its name stands. */
const NAMED_PAIRS = 25;

export class Trace {
  /**
   * @param {Element} root
   * @param {string} stream
   * @param {{title: string, unit: string, channels: string[], digits: number}} shown
   * @param {import("./view.js").Traces} all whose axis and marks are drawn
   */
  constructor(root, stream, shown, all) {
    this.shown = shown;
    this.all = all;
    this.clear();
    const { title, unit, channels } = shown;
    this.place = element("div", { class: "chart", role: "img" });
    this.place.setAttribute("aria-label", `${title}, ${unit}; the text below has its values`);
    this.values = channels.map(() => element("span", { class: "extent" }));
    this.count = element("span", { class: "count" });
    const head = element("h3", {}, `${title}, ${unit}`, this.count);
    const told = element("figcaption", {}, ...channels.map((name, i) => this.#words(name, i)));
    root.append(element("figure", { "data-stream": stream }, head, this.place, told));
    this.data = [[0, 1], ...channels.map(() => [null, null])];
    this.chart = new uPlot(this.#options(), this.data, this.place);
    // What is pointed at must stand still.
    this.place.addEventListener("mousedown", () => all.change((axis) => axis.pause()));
    new ResizeObserver(([{ contentRect }]) => {
      this.chart.setSize({ width: Math.floor(contentRect.width), height: HEIGHT_PX });
    }).observe(this.place);
  }

  clear() {
    this.history = new History(Math.ceil(KEPT_S / COLUMN_S));
    this.fresh = true;
    this.drawnMs = -Infinity;
  }

  /** A channel's name and values; its name shows and hides the line. */
  #words(name, channel) {
    const key = element("span", { class: "key", "aria-hidden": "true" });
    key.style.setProperty("--key", `var(${INKS[channel]})`);
    if (this.shown.channels.length === 1) return element("span", {}, key, this.values[channel]);
    const label = `${this.shown.title}, ${name}`;
    const attributes = { type: "button", class: "channel", "aria-pressed": "true" };
    const button = element("button", { ...attributes, "aria-label": label }, key, name);
    button.addEventListener("click", () => {
      const show = button.getAttribute("aria-pressed") !== "true";
      button.setAttribute("aria-pressed", String(show));
      this.chart.setSeries(channel + 1, { show });
    });
    return element("span", {}, button, " ", this.values[channel]);
  }

  #options() {
    const axis = { stroke: () => colour("--quiet"), grid: { stroke: () => colour("--grid") } };
    const line = (name, i) => ({
      label: name,
      fill: () => colour(INKS[i]),
      paths: envelope,
      points: { show: false },
    });
    return {
      width: 400,
      height: HEIGHT_PX,
      pxAlign: 0,
      padding: [null, NAMES_PX, null, null],
      legend: { show: false },
      cursor: {
        y: false,
        points: { show: false },
        drag: { x: true, y: false, setScale: false },
        sync: { key: "traces", filters: { pub: (type) => /move|leave/.test(type) } },
        bind: { dblclick: () => () => this.all.change((time) => time.resume()) },
      },
      scales: { x: { time: false, range: () => this.all.axis.range } },
      axes: [
        { ...axis, size: 24, space: 80, values: (_, at) => at.map((s) => `${s} s`) },
        { ...axis, size: 56, space: 16 },
      ],
      series: [{}, ...this.shown.channels.map(line)],
      hooks: {
        draw: [(chart) => this.#mark(chart), (chart) => this.#name(chart)],
        setCursor: [() => this.tell()],
        setSelect: [(chart) => this.#zoom(chart)],
      },
    };
  }

  #zoom(chart) {
    const { left, width } = chart.select;
    if (width < 2) return;
    const range = [left, left + width].map((px) => chart.posToVal(px, "x"));
    chart.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    this.all.change((axis) => axis.look(range));
  }

  /** A line where something happened: the log has what. */
  #mark(chart) {
    const { ctx, bbox } = chart;
    ctx.save();
    const { axis, clock, events } = this.all;
    for (const { ns, kind } of events.entries) {
      const x = chart.valToPos(clock(ns) - axis.originS, "x", true);
      if (!(x >= bbox.left && x <= bbox.left + bbox.width)) continue;
      ctx.fillStyle = colour(MARKS[kind] ?? "--ink");
      ctx.fillRect(x - devicePixelRatio, bbox.top, 2 * devicePixelRatio, bbox.height);
    }
    ctx.restore();
  }

  /** Write its name at the end of each line: no colour is needed to tell them apart. */
  #name(chart) {
    const { channels } = this.shown;
    if (channels.length === 1) return;
    const ends = channels.flatMap((_, channel) => {
      if (!chart.series[channel + 1].show) return [];
      const end = this.data[channel + 1].slice(-2 * NAMED_PAIRS).filter((value) => value !== null);
      if (end.length === 0) return [];
      const middle = (Math.min(...end) + Math.max(...end)) / 2;
      return [{ channel, at: chart.valToPos(middle, "y") }];
    });
    const row = ({ at }) => Math.round(at / APART_PX); // the same order, where they hardly differ
    const { ctx } = chart;
    const pxRatio = devicePixelRatio;
    ctx.save();
    ctx.scale(pxRatio, pxRatio);
    ctx.font = "600 12px system-ui, sans-serif";
    ctx.textAlign = "left";
    ctx.textBaseline = "middle";
    const right = (chart.bbox.left + chart.bbox.width) / pxRatio + 3;
    let least = -Infinity;
    for (const { channel, at } of ends.sort((a, b) => row(a) - row(b))) {
      const y = Math.max(at, least);
      ctx.fillStyle = colour(INKS[channel]);
      ctx.fillText(channels[channel], right, chart.bbox.top / pxRatio + y);
      least = y + APART_PX;
    }
    ctx.restore();
  }

  push(frame) {
    this.history.push(frame);
    this.fresh = true;
  }

  /** Columns shown: from where, how many pairs of how many merged ones. */
  get #part() {
    const { axis } = this.all;
    const columnS = this.history.columnS || COLUMN_S;
    const columns = Math.max(2, Math.round(axis.windowS / columnS));
    const merged = Math.ceil(columns / COLUMNS);
    const pairs = Math.ceil(columns / merged);
    // Merged ones begin where they began before, so that what moves does not flicker.
    const end = merged * Math.floor((axis.endS / columnS + 1e-6) / merged);
    return { columnS, from: end - pairs * merged, pairs, merged };
  }

  draw() {
    this.fresh = false;
    const { columnS, from, pairs, merged } = this.#part;
    if (this.data[0].length !== 2 * pairs) {
      this.data = this.data.map(() => new Array(2 * pairs).fill(null));
    }
    const [times, ...lines] = this.data;
    const since = from * columnS - this.all.axis.originS;
    for (let i = 0; i < times.length; i++) times[i] = since + (i * merged * columnS) / 2;
    lines.forEach((line, channel) => this.history.fill(line, channel, from, merged));
    this.chart.setData(this.data);
  }

  /** The values where the pointer is, or the extremes of what is shown. */
  tell() {
    const { digits } = this.shown;
    const { from, pairs, merged } = this.#part;
    const idx = this.chart?.cursor.idx ?? null;
    const [begin, end] =
      idx === null
        ? [from, from + pairs * merged]
        : [from + merged * (idx >> 1), from + merged * ((idx >> 1) + 1)];
    this.values.forEach((where, channel) => {
      const extent = this.history.extent(channel, begin, end);
      const text = extent?.map((value) => value.toFixed(digits)).join(" to ");
      say(where, text ?? "nothing received");
    });
    say(this.count, `${this.history.samples} samples, ${this.history.lost} lost`);
  }
}
