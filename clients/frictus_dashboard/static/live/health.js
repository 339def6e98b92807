/** How a rig's loop runs, and its counters with how fast they grow, as a table. */

import { CounterRates } from "./counter_rates.js";
import { at, element, say } from "../elements/element.js";

const LOOP = [
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
];
const COUNTERS = [
  ["Blocks", "blocks"],
  ["Blocks not published", "blocks_dropped", "worry"],
  ["Deadlines missed", "deadline_misses", "worry"],
  ["Underruns", "underruns", "worry"],
  ["Overruns", "overruns", "worry"],
  ["Samples clipped", "clipped_samples", "worry"],
  ["Samples extrapolated", "extrapolated_samples"],
  ["Touch reports stale", "stale_touches", "worry"],
  ["Commands refused", "refused_commands"],
  ["Trips", "trips", "worry"],
];

export class Health {
  constructor() {
    this.rates = new CounterRates();
    this.loop = LOOP.map(() => element("td", { colspan: 2 }));
    this.counts = COUNTERS.map(() => element("td"));
    this.perMinute = COUNTERS.map(() => element("td"));
    const row = (name, ...cells) => {
      return element("tr", {}, element("th", { scope: "row" }, name), ...cells);
    };
    at("health-rows").replaceChildren(
      ...LOOP.map(([name], i) => row(name, this.loop[i])),
      ...COUNTERS.map(([name], i) => row(name, this.counts[i], this.perMinute[i])),
    );
  }

  /** Forget everything: another rig is shown. */
  clear() {
    this.rates.clear();
  }

  /** @param {object} status a RigStatus */
  show(status) {
    this.rates.take(status);
    LOOP.forEach(([, value], i) => say(this.loop[i], value(status)));
    COUNTERS.forEach(([, name, worry], i) => {
      const rate = this.rates.perMinute(name);
      say(this.counts[i], String(status.counters[name]));
      say(this.perMinute[i], rate === null ? "…" : `${Number(rate.toPrecision(3))} per min`);
      this.counts[i].classList.toggle("worry", worry !== undefined && status.counters[name] > 0);
      this.perMinute[i].classList.toggle("worry", worry !== undefined && rate > 0);
    });
  }
}
