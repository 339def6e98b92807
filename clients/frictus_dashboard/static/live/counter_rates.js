/** How fast a rig's counters grow, from its statuses of the last minute. Pure. */

const WINDOW_NS = 60e9;
/** A shorter span says too little of a minute. */
const LEAST_NS = 5e9;

export class CounterRates {
  constructor() {
    this.heard = [];
  }

  /** @param {{run: number, utc_ns: number, counters: object}} status a RigStatus */
  take({ run, utc_ns: ns, counters }) {
    const last = this.heard.at(-1);
    // Another rig, one that was started again, or a clock that was set: nothing to compare.
    if (last !== undefined && (last.run !== run || ns < last.ns)) this.heard = [];
    if (this.heard.at(-1)?.ns === ns) return; // shown once more
    this.heard.push({ run, ns, counters });
    while (ns - this.heard[0].ns > WINDOW_NS) this.heard.shift();
  }

  /** Forget everything: another rig is shown. */
  clear() {
    this.heard = [];
  }

  /** How much a counter grows per minute; null: not known yet. @param {string} name */
  perMinute(name) {
    const [first, last] = [this.heard[0], this.heard.at(-1)];
    const spanNs = (last?.ns ?? 0) - (first?.ns ?? 0);
    if (spanNs < LEAST_NS) return null;
    return ((last.counters[name] - first.counters[name]) * 60e9) / spanNs;
  }
}
