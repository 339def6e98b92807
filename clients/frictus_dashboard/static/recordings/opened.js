/** One recording of the list: how it went, and in which forms it can be saved. */

import { colour, onSchemeChange } from "../canvas/colours.js";
import { request, send } from "../connection/api.js";
import { saveBlob } from "../connection/download.js";
import { coded } from "../elements/coded.js";
import { element, say } from "../elements/element.js";
import { button } from "../elements/fields.js";
import { Outcome } from "../elements/outcome.js";
import uPlot from "../vendor/uplot.mjs";
import { eventsOf, extentOf, timesOf, TITLES } from "./course.js";

const HEIGHT_PX = 96;
const NOTHING = [[0, 1], [null, null], [null, null]];
/** By form: where the service has it, the suffix of the file, and what the button says. */
const FORMS = {
  recording: { path: "recording.mcap", suffix: ".mcap", label: "Download (MCAP)" },
  study: { path: "export/study", suffix: ".h5", label: "As a study (HDF5)" },
  replay: { path: "export/replay", suffix: ".npz", label: "As a rig to replay (NPZ)" },
};

const FREE =
  "Nobody was guided in it, as in a calibration. To make a study of it, say what was done: " +
  "on the service's machine, `frictus export --help` tells how.";

export class Opened {
  constructor() {
    this.name = null;
    this.title = element("h3", { tabindex: "-1" });
    this.forms = Object.entries(FORMS).map(([form, { label }]) => {
      return button(label, () => this.#save(form));
    });
    this.study = this.forms[Object.keys(FORMS).indexOf("study")];
    this.free = element("p", { class: "quiet" });
    this.outcome = new Outcome();
    this.note = element("p", { class: "quiet" });
    this.charts = Object.keys(TITLES).map((signal) => new SignalChart(signal));
    this.events = element("ul", { class: "happened" });
    this.command = element("code");
    const play = element("p", {}, "To play it as one more rig of this service: ", this.command);
    const closing = button("Close", () => (this.root.hidden = true));
    const actions = element("p", { class: "fields" }, ...this.forms, closing);
    const drawn = this.charts.map(({ root }) => root);
    this.root = element("section", { class: "opened", "aria-label": "One recording" });
    this.root.append(this.title, actions, this.free, this.outcome.root, this.note, ...drawn, this.events, play);
    this.root.hidden = true;
  }

  /**
   * @param {string} name of a finished recording
   * @param {{folder: string, site: string, router: string}} found where the service has it
   */
  async open(name, found) {
    this.name = name;
    this.root.hidden = false;
    this.outcome.clear();
    say(this.title, name);
    say(this.note, "Reading it…");
    say(this.command, replaying(name, found));
    this.#draw(null);
    this.#offer(null);
    this.title.focus();
    const wanted = () => this.name === name;
    const patient = new AbortController(); // a long one takes seconds
    const asked = request("GET", `${pathOf(name)}/course`, { signal: patient.signal });
    const course = await this.outcome.of(asked, "It cannot be shown", wanted);
    if (!wanted()) return;
    say(this.note, course === null ? "" : sentence(course));
    this.#offer(course);
    this.#draw(course);
  }

  #draw(course) {
    for (const chart of this.charts) chart.show(course);
    const told = course === null ? [] : eventsOf(course);
    this.events.replaceChildren(...told.map((text) => element("li", {}, text)));
  }

  /** What it can be saved as: a study is made of guided trials, or by who knows what was done. */
  #offer(course) {
    this.guided = course === null || course.guided_trials > 0;
    this.#enable();
    this.free.replaceChildren(...(this.guided ? [] : coded(FREE)));
  }

  #enable() {
    for (const each of this.forms) each.disabled = each === this.study && !this.guided;
  }

  async #save(form) {
    const { name } = this;
    const { path, suffix, label } = FORMS[form];
    for (const each of this.forms) each.disabled = true;
    this.outcome.good(`${label}: being made…`);
    const patient = new AbortController(); // no deadline: it may be large
    const asked = this.#fetched(`${pathOf(name)}/${path}`, patient.signal);
    const wanted = () => this.name === name;
    const got = await this.outcome.of(asked, `${name} is not saved`, wanted);
    this.#enable();
    if (got === null) return;
    saveBlob(got.blob, `${name}${suffix}`);
    if (wanted()) this.outcome.good(`${name}${suffix} is saved. ${got.notes}`.trim());
  }

  async #fetched(path, signal) {
    const answer = await send("GET", path, { signal });
    return { blob: await answer.blob(), notes: answer.headers.get("Frictus-Notes") ?? "" };
  }
}

/** The command by which the machine of the service plays a recording on the router of its rigs. */
export function replaying(name, { folder, site, router }) {
  const file = `${folder}/${name}.mcap`;
  const quoted = /^[\w./:\\-]+$/.test(file) ? file : `"${file}"`;
  return `frictus replay ${quoted} --router ${router} --site ${site}`;
}

function pathOf(name) {
  return `/recordings/${encodeURIComponent(name)}`;
}

function sentence({ ending }) {
  return `${ending[0].toUpperCase()}${ending.slice(1)}. Drawn over time in s.`;
}

/** An axis that has room about what is drawn, also where that is one value. */
function around(least, most) {
  const room = 0.1 * (most - least || Math.abs(most) || 1);
  return [least - room, most + room];
}

/** The extremes of one signal over time. */
class SignalChart {
  constructor(signal) {
    this.signal = signal;
    this.extent = element("span", { class: "count" });
    this.place = element("div", { class: "chart", role: "img" });
    const head = element("figcaption", {}, `${TITLES[signal]} `, this.extent);
    this.root = element("figure", {}, head, this.place);
    this.chart = new uPlot(options(), NOTHING, this.place);
    new ResizeObserver(([{ contentRect }]) => {
      const width = Math.floor(contentRect.width);
      if (width > 0) this.chart.setSize({ width, height: HEIGHT_PX });
    }).observe(this.place);
    onSchemeChange(() => this.chart.redraw());
  }

  /** @param {object|null} course as the service tells it; null: nothing yet */
  show(course) {
    const drawn = course?.signals.find(({ name }) => name === this.signal) ?? null;
    const extent = drawn === null ? "" : extentOf(drawn);
    this.root.hidden = drawn === null;
    say(this.extent, extent);
    this.place.setAttribute("aria-label", `${TITLES[this.signal]} over time: ${extent}`);
    this.chart.setData(drawn === null ? NOTHING : [timesOf(course), drawn.low, drawn.high]);
  }
}

function options() {
  const axis = { stroke: () => colour("--quiet"), grid: { stroke: () => colour("--grid") } };
  const edge = { stroke: () => colour("--trace-1"), width: 1, points: { show: false } };
  return {
    width: 400,
    height: HEIGHT_PX,
    legend: { show: false },
    cursor: { show: false },
    scales: {
      x: { time: false, range: (_plot, _least, last) => [0, last ?? 1] },
      y: { range: (_plot, least, most) => (least === null ? [0, 1] : around(least, most)) },
    },
    axes: [{ ...axis, size: 28 }, { ...axis, size: 56, space: 20 }],
    series: [{}, edge, edge],
    bands: [{ series: [2, 1], fill: () => colour("--band") }],
  };
}
