/** Force, acceleration and voltage over time: a chart, and its extremes in words. */

import { colour } from "./colours.js";
import { element, say } from "./element.js";
import { envelope } from "./envelope.js";
import uPlot from "./vendor/uplot.mjs";
import { ColumnWindow } from "./window.js";

export const COLUMNS = 500;
export const WINDOW_S = 2.0;
const HEIGHT_PX = 108;
/** Streams shown, with the names and the unit of their channels. */
const SHOWN = {
  force: { title: "Force on the finger", unit: "N", channels: ["x", "y", "z"], digits: 3 },
  accel: { title: "Acceleration", unit: "m/s²", channels: ["x", "y", "z"], digits: 2 },
  voltage: { title: "Screen voltage", unit: "V", channels: ["monitor"], digits: 1 },
};
export const STREAMS = Object.keys(SHOWN);
const INKS = ["--trace-1", "--trace-2", "--trace-3"];
/** Room to the right for the names of the lines, and the least between two of them. */
const NAMES_PX = 14;
const APART_PX = 11;
/** The end of a line, by which its name stands. */
const NAMED_COLUMNS = 25;

class Trace {
  constructor(root, stream) {
    this.shown = SHOWN[stream];
    this.window = new ColumnWindow(COLUMNS, WINDOW_S);
    this.dirty = false;
    const { title, unit, channels } = this.shown;
    this.place = element("div", { class: "chart", role: "img" });
    this.place.setAttribute("aria-label", `${title}, ${unit}; the text below has its values`);
    this.values = channels.map(() => element("span", { class: "extent" }));
    this.count = element("span", { class: "count" });
    const words = channels.map((name, i) => {
      return element("span", {}, this.#key(i), element("b", {}, name), " ", this.values[i]);
    });
    const head = element("h3", {}, `${title}, ${unit}`, this.count);
    const told = element("figcaption", {}, ...words);
    root.append(element("figure", { "data-stream": stream }, head, this.place, told));
    this.chart = new uPlot(this.#options(), this.#data(), this.place);
    new ResizeObserver(([{ contentRect }]) => {
      this.chart.setSize({ width: Math.floor(contentRect.width), height: HEIGHT_PX });
    }).observe(this.place);
  }

  #key(channel) {
    const key = element("span", { class: "key", "aria-hidden": "true" });
    key.style.setProperty("--key", `var(${INKS[channel]})`);
    return key;
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
      cursor: { show: false },
      scales: { x: { time: false, range: [-WINDOW_S, 0] } },
      axes: [
        { ...axis, size: 24, space: 80, values: (_, at) => at.map((s) => `${s} s`) },
        { ...axis, size: 56, space: 16 },
      ],
      series: [{}, ...this.shown.channels.map(line)],
      hooks: { draw: [(chart) => this.#name(chart)] },
    };
  }

  /** Write its name at the end of each line: no colour is needed to tell them apart. */
  #name(chart) {
    if (this.shown.channels.length === 1) return;
    const ends = this.window.values.flatMap((_, channel) => {
      const end = this.window.extent(channel, NAMED_COLUMNS);
      return end === null ? [] : [{ channel, at: chart.valToPos((end[0] + end[1]) / 2, "y") }];
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
      ctx.fillText(this.shown.channels[channel], right, chart.bbox.top / pxRatio + y);
      least = y + APART_PX;
    }
    ctx.restore();
  }

  #data() {
    const { times, values } = this.window;
    const empty = times.map(() => null);
    return [times, ...this.shown.channels.map((_, channel) => values[channel] ?? empty)];
  }

  push(frame) {
    this.window.push(frame);
    this.dirty = true;
  }

  draw() {
    if (!this.dirty) return;
    this.dirty = false;
    this.chart.setData(this.#data());
  }

  tell() {
    const { digits, channels } = this.shown;
    channels.forEach((_, channel) => {
      const extent = this.window.extent(channel);
      const text = extent?.map((value) => value.toFixed(digits)).join(" to ");
      say(this.values[channel], text ?? "nothing received");
    });
    const { samples, lost } = this.window;
    say(this.count, `${samples} samples, ${lost} lost`);
  }
}

/** All traces of the page. */
export class Traces {
  /** @param {Element} root */
  constructor(root) {
    this.traces = Object.fromEntries(STREAMS.map((stream) => [stream, new Trace(root, stream)]));
  }

  push(frame) {
    this.traces[frame.stream]?.push(frame);
  }

  draw() {
    for (const trace of Object.values(this.traces)) trace.draw();
  }

  /** Bring the words up to date. */
  tell() {
    for (const trace of Object.values(this.traces)) trace.tell();
  }

  /** Draw anew, in the colours of now. */
  redraw() {
    for (const { chart } of Object.values(this.traces)) chart.redraw();
  }
}
