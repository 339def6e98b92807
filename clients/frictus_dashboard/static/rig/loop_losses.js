/** What a rig's loop has lost since its start, and lately, from the counters of its status. */

/** For so long a loss is news, ms. */
const NEWS_MS = 30_000;
/** Counters that only grow where something went wrong, as they are called on the page. */
export const LOSSES = {
  blocks_dropped: "blocks not published",
  deadline_misses: "deadlines missed",
  underruns: "underruns",
  overruns: "overruns",
  clipped_samples: "samples clipped",
  stale_touches: "touch reports stale",
};

export class LoopLosses {
  constructor() {
    this.clear();
  }

  /** Forget everything: another rig is shown. */
  clear() {
    this.run = null;
    this.counters = null;
    this.grownMs = {};
  }

  /**
   * @param {{run: number, counters: object}} status a RigStatus
   * @returns {{name: string, grown: number}[]} which losses have grown since the one before
   */
  take({ run, counters }, nowMs) {
    const before = run === this.run ? this.counters : null;
    if (before === null) this.grownMs = {};
    this.run = run;
    this.counters = counters;
    if (before === null) return []; // what was lost before the page came is no news
    const news = Object.keys(LOSSES).flatMap((name) => {
      const grown = counters[name] - before[name];
      return grown > 0 ? [{ name, grown }] : [];
    });
    for (const { name } of news) this.grownMs[name] = nowMs;
    return news;
  }

  /** Names of the counters that grew lately. */
  recent(nowMs) {
    return Object.keys(this.grownMs).filter((name) => nowMs - this.grownMs[name] < NEWS_MS);
  }
}
