/** What a stream has sent lately: the least and the greatest value of each column. Pure. */

export class History {
  /** @param {number} capacity how many columns are kept */
  constructor(capacity) {
    this.capacity = capacity;
    this.samples = 0;
    this.lost = 0;
    this.run = null;
    this.columnS = 0;
    /** Columns are numbered from the first sample of the device; those before `end` may be there. */
    this.begin = this.end = 0;
    this.low = [];
    this.high = [];
  }

  /** When its newest column ends, s since the device's first sample. */
  get endS() {
    return this.end * this.columnS;
  }

  /** Put the columns of a frame where they belong; between them and those before there are none. */
  push(frame) {
    const columnS = frame.samplesPerColumn / frame.sampleRateHz;
    const first = Math.floor(frame.firstSample / frame.samplesPerColumn);
    const { run, channels, columns } = frame;
    if (run !== this.run || channels !== this.low.length || columnS !== this.columnS) {
      Object.assign(this, { run, columnS, begin: first, end: first });
      this.low = Array.from({ length: channels }, () => new Float32Array(this.capacity));
      this.high = Array.from({ length: channels }, () => new Float32Array(this.capacity));
    }
    const blank = Math.max(this.end, first - this.capacity);
    for (let column = blank; column < first; column++) this.#set(column, () => NaN, () => NaN);
    for (let i = Math.max(0, columns - this.capacity, this.begin - first); i < columns; i++) {
      this.#set(first + i, (channel) => frame.low[channel][i], (channel) => frame.high[channel][i]);
    }
    this.end = Math.max(this.end, first + columns);
    this.begin = Math.max(this.begin, this.end - this.capacity);
    this.samples += columns * frame.samplesPerColumn;
    this.lost += frame.lostSamples;
  }

  #set(column, low, high) {
    const place = column % this.capacity;
    for (let channel = 0; channel < this.low.length; channel++) {
      this.low[channel][place] = low(channel);
      this.high[channel][place] = high(channel);
    }
  }

  /**
   * Least and greatest value of a channel in columns `from` to before `to`; null where none is.
   *
   * @returns {[number, number]|null}
   */
  extent(channel, from, to) {
    const low = this.low[channel];
    const high = this.high[channel];
    if (low === undefined) return null;
    let least = Infinity;
    let greatest = -Infinity;
    const end = Math.min(to, this.end);
    for (let column = Math.max(from, this.begin); column < end; column++) {
      const place = column % this.capacity;
      // A column without values is NaN, which is neither less nor greater.
      if (low[place] < least) least = low[place];
      if (high[place] > greatest) greatest = high[place];
    }
    return least <= greatest ? [least, greatest] : null;
  }

  /**
   * Fill `into` with pairs, least and greatest, each of `merged` columns, the first at `from`.
   *
   * @param {(number|null)[]} into as a chart wants it
   */
  fill(into, channel, from, merged) {
    for (let pair = 0; 2 * pair < into.length; pair++) {
      const column = from + pair * merged;
      const extent = this.extent(channel, column, column + merged);
      into[2 * pair] = extent === null ? null : extent[0];
      into[2 * pair + 1] = extent === null ? null : extent[1];
    }
  }
}
