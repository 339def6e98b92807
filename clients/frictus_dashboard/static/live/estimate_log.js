/** What a tracker has said of one rig: the newest estimate, its age, and its last 10 minutes. */

/** As far back as parameters are kept, s; twice a second makes 1200 of them. */
export const SPAN_S = 600;
const MOST = 1_500;
/** Longer without an estimate, a tracker has ended or hangs. */
export const STALE_MS = 3_000;

export class EstimateLog {
  constructor() {
    this.clear();
  }

  /** Forget everything: another rig is shown. */
  clear() {
    this.newest = null;
    this.heardMs = -Infinity;
    /** Of each estimate with a law: {s, law, inForce, anew}, s by the tracker's clock. */
    this.entries = [];
  }

  /**
   * @param {object} estimate an EstimateState
   * @param {number} nowMs by the page's monotonic clock
   * @param {number|undefined} rigNs UTC that the rig said last
   */
  take(estimate, nowMs, rigNs) {
    const before = this.newest;
    // What was said before a reconnection is told once more: it has not become younger.
    if (before !== null && before.utc_ns === estimate.utc_ns) return;
    // The first may be the last word of a tracker that ended long ago.
    const lagMs = before === null && rigNs ? Math.max(0, (rigNs - estimate.utc_ns) / 1e6) : 0;
    this.heardMs = nowMs - lagMs;
    this.newest = estimate;
    if (estimate.law === null) return;
    const s = estimate.utc_ns / 1e9;
    const anew = before !== null && isAnother(before, estimate);
    this.entries = this.entries.filter((entry) => entry.s < s && entry.s >= s - SPAN_S);
    this.entries.push({ s, law: estimate.law, inForce: estimate.in_force, anew });
    if (this.entries.length > MOST) this.entries.shift();
  }

  /** How long ago the newest was said, ms. */
  ageMs(nowMs) {
    return nowMs - this.heardMs;
  }
}

/** Whether what is known was begun anew: another finger, or another tracker. */
function isAnother(before, after) {
  return after.new_fingers !== before.new_fingers || after.windows < before.windows;
}
