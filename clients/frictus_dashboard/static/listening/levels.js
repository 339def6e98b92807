/** Target and felt friction in third octaves: levels, errors, and all of it as a table. */

import { colour } from "../canvas/colours.js";
import { element, say } from "../elements/element.js";
import { CENTRES_HZ, JND_DB, NOMINAL_HZ, errorsDb, levelsDb, uncompensated } from "./spectrum.js";
import uPlot from "../vendor/uplot.mjs";

const HEIGHT_PX = 170;
/** Shown under the strongest band, dB. */
const DEPTH_DB = 40;
/** Least and greatest half height of the errors, dB. */
const REACH_DB = [4, 16];
const TICKS_HZ = [31.5, 63, 125, 250, 500, 1000];
const TARGET = { name: "Target", ink: "--ink", width: 2, dash: [7, 3] };
const FELT = { name: "Felt", ink: "--trace-1", width: 3, points: true };
const BARE = {
  name: "Without compensation, by the model",
  ink: "--trace-2",
  width: 2,
  dash: [2, 3],
};
const EDGE = { name: `± ${JND_DB} dB: a difference just felt`, ink: "--band", width: 1 };
const BLANK = CENTRES_HZ.map(() => null);

export class Levels {
  /** @param {Element} root a figure */
  constructor(root) {
    this.summary = element("p", { class: "summary" });
    const levels = this.#chart(root, "Level in third octaves, dB re 1 N rms", [TARGET, FELT, BARE]);
    const errors = this.#chart(root, "Error against the target, dB", [EDGE, EDGE, FELT, BARE]);
    root.prepend(this.summary);
    root.append(this.#table());
    this.levels = plot(levels, [TARGET, FELT, BARE], levelRange);
    const band = [{ series: [2, 1], fill: () => colour("--band") }];
    this.errors = plot(errors, [EDGE, EDGE, FELT, BARE], errorRange, band);
    new ResizeObserver(([{ contentRect }]) => {
      const size = { width: Math.floor(contentRect.width), height: HEIGHT_PX };
      for (const chart of [this.levels, this.errors]) chart.setSize(size);
    }).observe(levels);
  }

  /**
   * @param {{felt: Float64Array, target: Float64Array|null, speedMmS: number}|null} spectra
   * @param {object|null} law the model's base law
   */
  show(spectra, law) {
    const felt = spectra && levelsDb(spectra.felt);
    const target = spectra?.target ? levelsDb(spectra.target) : null;
    const errors = target && errorsDb(spectra.felt, spectra.target);
    const known = target !== null && law?.law === "first_order_speed";
    const bare = known ? uncompensated(spectra.target, law, spectra.speedMmS) : null;
    const bareErrors = bare && errorsDb(bare, spectra.target);
    const judged = (levels) => levels?.map((level, i) => (errors[i] === null ? null : level));
    const edge = (by) => (target ? CENTRES_HZ.map(() => by) : null);
    put(this.levels, [judged(target), felt, bare && judged(levelsDb(bare))]);
    put(this.errors, [edge(-JND_DB), edge(JND_DB), errors, bareErrors]);
    this.#tell(target, felt, errors);
  }

  redraw() {
    this.levels.redraw();
    this.errors.redraw();
  }

  #chart(root, title, lines) {
    const place = element("div", { class: "chart", role: "img" });
    place.setAttribute("aria-label", `${title}; the table below has its values`);
    const keys = [...new Set(lines)].map(({ name, ink }) => {
      const mark = element("span", { class: ink === "--band" ? "key wide" : "key" });
      mark.style.setProperty("--key", `var(${ink})`);
      return element("li", {}, mark, name);
    });
    root.append(element("h3", {}, title), place, element("ul", { class: "keys" }, ...keys));
    return place;
  }

  #table() {
    this.rows = NOMINAL_HZ.map(() => Array.from({ length: 3 }, () => element("td", {}, "–")));
    const head = ["Band, Hz", "Target, dB", "Felt, dB", "Error, dB"].map((text) =>
      element("th", { scope: "col" }, text),
    );
    const rows = NOMINAL_HZ.map((hz, i) =>
      element("tr", {}, element("th", { scope: "row" }, String(hz)), ...this.rows[i]),
    );
    const table = element(
      "table",
      {},
      element("caption", { class: "quiet" }, "Level re 1 N rms, every second"),
      element("thead", {}, element("tr", {}, ...head)),
      element("tbody", {}, ...rows),
    );
    return element("details", {}, element("summary", {}, "As a table"), table);
  }

  #tell(target, felt, errors) {
    const text = (levels, i) => levels?.[i]?.toFixed(1) ?? "–";
    this.rows.forEach(([wanted, got, error], i) => {
      say(wanted, text(target, i));
      say(got, text(felt, i));
      say(error, errors ? (errors[i]?.toFixed(1) ?? "too weak") : "–");
    });
    const judged = errors?.filter((error) => error !== null) ?? [];
    const within = judged.filter((error) => Math.abs(error) <= JND_DB).length;
    const rms = Math.sqrt(judged.reduce((sum, e) => sum + e * e, 0) / judged.length);
    const found = `${within} of ${judged.length} bands within ${JND_DB} dB`;
    say(this.summary, judged.length ? `${found}; ${rms.toFixed(2)} dB rms` : "");
  }
}

function plot(place, lines, range, bands = []) {
  const data = [CENTRES_HZ, ...lines.map(() => BLANK)];
  return new uPlot(options(lines, range, bands), data, place);
}

function put(chart, lines) {
  chart.setData([CENTRES_HZ, ...lines.map((line) => line ?? BLANK)]);
}

function levelRange(_chart, _least, most) {
  const top = most == null ? 0 : 10 * Math.ceil(most / 10);
  return [top - DEPTH_DB, top];
}

function errorRange(_chart, least, most) {
  const needed = Math.ceil(Math.max(-least, most));
  const reach = Math.min(REACH_DB[1], Math.max(REACH_DB[0], needed));
  return [-reach, reach];
}

function options(lines, range, bands) {
  const axis = { stroke: () => colour("--quiet"), grid: { stroke: () => colour("--grid") } };
  const named = (hz) => (hz < 1_000 ? String(hz) : "1 kHz");
  return {
    width: 400,
    height: HEIGHT_PX,
    legend: { show: false },
    cursor: { show: false },
    scales: { x: { time: false, distr: 3, range: [28, 1_120] }, y: { range } },
    axes: [
      { ...axis, splits: () => TICKS_HZ, values: () => TICKS_HZ.map(named), size: 28 },
      { ...axis, size: 56, space: 24 },
    ],
    series: [
      {},
      ...lines.map(({ name, ink, width, dash, points }) => ({
        label: name,
        width,
        dash,
        stroke: () => colour(ink),
        points: { show: points === true, size: 7, fill: () => colour(ink) },
      })),
    ],
    bands,
  };
}
