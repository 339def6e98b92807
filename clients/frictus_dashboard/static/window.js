/** The newest columns of one stream, as a chart wants them. Pure. */

export class ColumnWindow {
  /**
   * @param {number} columns how many are kept
   * @param {number} windowS how long they span, s
   */
  constructor(columns, windowS) {
    this.columns = columns;
    /** Two points a column, its least and its greatest value; seconds before now. */
    this.times = Array.from({ length: 2 * columns }, (_, i) => (i / (2 * columns) - 1) * windowS);
    this.samples = 0;
    this.lost = 0;
    this.clear(0);
  }

  /** Forget all values, as after a restart of the rig. */
  clear(channels) {
    this.run = null;
    this.values = Array.from({ length: channels }, () => new Array(2 * this.columns).fill(null));
  }

  /** Append the columns of a frame; where samples were lost, a gap as long as they. */
  push(frame) {
    if (frame.run !== this.run || frame.channels !== this.values.length) {
      this.clear(frame.channels);
      this.run = frame.run;
    }
    const gap = Math.min(this.columns, Math.round(frame.lostSamples / frame.samplesPerColumn));
    const fresh = Math.min(this.columns, frame.columns);
    const skipped = frame.columns - fresh;
    const shift = 2 * Math.min(this.columns, gap + fresh);
    const begin = 2 * (this.columns - fresh);
    this.values.forEach((kept, channel) => {
      kept.copyWithin(0, shift);
      kept.fill(null, 2 * this.columns - shift);
      const low = frame.low[channel];
      const high = frame.high[channel];
      for (let i = 0; i < fresh; i++) {
        kept[begin + 2 * i] = low[skipped + i];
        kept[begin + 2 * i + 1] = high[skipped + i];
      }
    });
    this.samples += frame.columns * frame.samplesPerColumn;
    this.lost += frame.lostSamples;
  }

  /**
   * Least and greatest value of a channel in the window, or in its last columns; null where
   * there is none.
   */
  extent(channel, columns = this.columns) {
    let low = Infinity;
    let high = -Infinity;
    for (const value of this.values[channel]?.slice(-2 * columns) ?? []) {
      if (value === null) continue;
      if (value < low) low = value;
      if (value > high) high = value;
    }
    return low <= high ? [low, high] : null;
  }
}
