/** Bode plot: points measured with intervals, the estimate with its band, the model in force. */

import { colour, onSchemeChange } from "../canvas/colours.js";
import { element, say } from "../elements/element.js";
import { drawPoints } from "../canvas/measured_points.js";
import uPlot from "../vendor/uplot.mjs";
import { FREQUENCIES_HZ } from "./law.js";
import { GROUPS } from "./speed_groups.js";
import { frequency } from "./units.js";

const HEIGHT_PX = 236;
const TICKS_HZ = [50, 100, 200, 500, 1000, 2000];
const FROM_TO_HZ = [FREQUENCIES_HZ[0], FREQUENCIES_HZ.at(-1)];
/** The level's axis ends at multiples of this, dB: it does not move with every estimate. */
const STEP_DB = 5;
/** Behind a colour of six digits: how much of it covers what lies below. */
const BAND_ALPHA = "30";
/** Series of one group: the band's ends, the estimate, the model in force. */
const PER_GROUP = 4;
const TOLD_HZ = [100, 500, 1000];

export class LiveBode {
  constructor() {
    this.groups = GROUPS.map(() => null);
    this.place = element("div", { class: "chart", role: "img", "aria-describedby": "bode-values" });
    this.place.setAttribute("aria-label", "Friction per drive over frequency: Bode plot, level");
    this.values = element("p", { id: "bode-values", class: "unseen" });
    this.keys = element("ul", { class: "keys" });
    this.root = element("figure", { class: "bode" }, this.place, this.keys, this.values);
    this.chart = new uPlot(this.#options(), this.#data(), this.place);
    new ResizeObserver(([{ contentRect }]) => {
      const width = Math.floor(contentRect.width);
      if (width > 0) this.chart.setSize({ width, height: HEIGHT_PX });
    }).observe(this.place);
    onSchemeChange(() => this.chart.redraw());
  }

  /** @param {object} state of `viewStateOf` */
  show({ groups }) {
    this.groups = groups ?? GROUPS.map(() => null);
    this.chart.setData(this.#data());
    const shown = this.groups.filter((group) => group !== null);
    this.place.dataset.points = shown.reduce((sum, { points }) => sum + points.length, 0);
    this.place.dataset.curves = shown.reduce((sum, { inForce }) => sum + (inForce ? 2 : 1), 0);
    say(this.values, shown.map(described).join(" ") || "Nothing is measured yet.");
    this.keys.replaceChildren(...keysOf(shown));
  }

  #data() {
    const none = FREQUENCIES_HZ.map(() => null);
    const lines = this.groups.flatMap((group) => {
      if (group === null) return [none, none, none, none];
      return [group.high, group.low, group.estimate, group.inForce ?? none];
    });
    return [FREQUENCIES_HZ, ...lines];
  }

  #options() {
    const axis = { stroke: () => colour("--quiet"), grid: { stroke: () => colour("--grid") } };
    const named = (hz) => (hz < 1_000 ? String(hz) : `${hz / 1_000} k`);
    const hidden = { width: 0, points: { show: false } };
    const series = GROUPS.flatMap(({ ink }) => [
      { ...hidden, stroke: "transparent" },
      { ...hidden, stroke: "transparent" },
      { width: 2.5, stroke: () => colour(ink), points: { show: false } },
      { width: 2, dash: [8, 5], stroke: () => colour(ink), points: { show: false } },
    ]);
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
        {
          ...axis,
          splits: () => TICKS_HZ,
          values: () => TICKS_HZ.map(named),
          size: 30,
          label: "Frequency, Hz",
          labelSize: 20,
          labelFont: "13px system-ui, sans-serif",
        },
        { ...axis, size: 46, space: 28 },
      ],
      series: [{}, ...series],
      bands: GROUPS.map(({ ink }, i) => ({
        series: [PER_GROUP * i + 1, PER_GROUP * i + 2],
        fill: () => `${colour(ink)}${BAND_ALPHA}`,
      })),
      hooks: { draw: [(chart) => drawPoints(chart, this.groups)] },
    };
  }

  #range() {
    const levels = this.groups.flatMap((group) => {
      if (group === null) return [];
      const { points, estimate, inForce } = group;
      return [...estimate, ...(inForce ?? []), ...points.map(({ db }) => db)];
    });
    if (levels.length === 0) return [-20, 0];
    return [
      STEP_DB * Math.floor((Math.min(...levels) - 0.5) / STEP_DB),
      STEP_DB * Math.ceil((Math.max(...levels) + 0.5) / STEP_DB),
    ];
  }
}

function keysOf(shown) {
  const groups = shown.map(({ ink, sign, speedMmS, points }) => {
    const what = points.length > 0 ? `${sign} ` : "";
    const made = element("li", {}, `${what}${speedMmS.toFixed(0)} mm/s`);
    made.style.setProperty("color", `var(${ink})`);
    return made;
  });
  const line = (look, text) => {
    return element("li", {}, element("span", { class: look, "aria-hidden": "true" }), text);
  };
  const measured = shown.some(({ points }) => points.length > 0);
  const inForce = shown.some((group) => group.inForce !== null);
  return [
    ...groups,
    ...(measured ? [element("li", {}, "┼ measured, 95 %")] : []),
    line("key", "learned, band 95 %"),
    ...(inForce ? [line("key broken", "model in force")] : []),
  ];
}

/** The values of one group in words, for who does not see the plot. */
function described({ speedMmS, points, estimate, inForce }) {
  const at = (levels, hz) => {
    const i = FREQUENCIES_HZ.findIndex((each) => each >= hz);
    return `${levels[i].toFixed(1)} dB`;
  };
  const told = TOLD_HZ.map((hz) => {
    const model = inForce === null ? "" : `, model in force ${at(inForce, hz)}`;
    return `at ${frequency(hz)} learned ${at(estimate, hz)}${model}`;
  });
  return `At ${speedMmS.toFixed(0)} mm/s, ${points.length} points measured: ${told.join("; ")}.`;
}
