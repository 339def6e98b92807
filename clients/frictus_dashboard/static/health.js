/** How a rig's loop runs, and its counters, as a table. */

import { at, element, say } from "./element.js";

const ROWS = [
  ["Late, half of the blocks", ({ timing }) => `${timing.lateness_p50_ms.toFixed(2)} ms`],
  ["Late, 99 of 100 blocks", ({ timing }) => `${timing.lateness_p99_ms.toFixed(2)} ms`],
  ["Late, worst since the start", ({ timing }) => `${timing.lateness_max_ms.toFixed(2)} ms`],
  ["Least output left in reserve", ({ timing }) => `${timing.margin_min_ms.toFixed(2)} ms`],
  ["Lead", ({ lead_ms: lead, max_lead_ms: longest, counters }) => {
    const grown = counters.lead_growths ? `, grown ${counters.lead_growths}×` : "";
    const room = longest > lead ? `, may grow to ${longest.toFixed(1)} ms` : "";
    return `${lead.toFixed(1)} ms${grown}${room}`;
  }],
  ["Finger followed by", ({ finger_sensors: by }) => by?.join(", ") || "nothing"],
  ["Blocks", ({ counters }) => counters.blocks],
  ["Blocks not published", ({ counters }) => counters.blocks_dropped, "worry"],
  ["Deadlines missed", ({ counters }) => counters.deadline_misses, "worry"],
  ["Underruns", ({ counters }) => counters.underruns, "worry"],
  ["Overruns", ({ counters }) => counters.overruns, "worry"],
  ["Samples clipped", ({ counters }) => counters.clipped_samples, "worry"],
  ["Samples extrapolated", ({ counters }) => counters.extrapolated_samples],
  ["Touch reports stale", ({ counters }) => counters.stale_touches, "worry"],
  ["Commands refused", ({ counters }) => counters.refused_commands],
  ["Trips", ({ counters }) => counters.trips, "worry"],
];

export class Health {
  constructor() {
    this.cells = ROWS.map(() => element("td"));
    const rows = ROWS.map(([name], i) => {
      return element("tr", {}, element("th", { scope: "row" }, name), this.cells[i]);
    });
    at("health-rows").replaceChildren(...rows);
  }

  /** @param {object} status a RigStatus */
  show(status) {
    ROWS.forEach(([, value, worry], i) => {
      const shown = value(status);
      say(this.cells[i], String(shown));
      this.cells[i].classList.toggle("worry", worry !== undefined && shown > 0);
    });
  }
}
