/** A binary frame of /v1/live to typed arrays. Pure; docs/websocket.md has the layout. */

export const HEADER_BYTES = 56;
export const STREAMS = { 1: "force", 2: "accel", 3: "voltage", 4: "truth", 5: "aux", 6: "render" };
const VERSION = 1;
const RAW = 0;
const MIN_MAX = 1;

/** Bits of `flags`: what a block says of itself. */
export const FLAGS = {
  armed: 1 << 0,
  clipped: 1 << 1,
  scaled: 1 << 2,
  extrapolated: 1 << 3,
  overrun: 1 << 4,
  underrun: 1 << 5,
  simulated: 1 << 6,
  stale: 1 << 7,
  placeholder: 1 << 8,
  substitute: 1 << 9,
  saturated: 1 << 10,
};

/**
 * @param {ArrayBuffer} buffer
 * @returns {{stream: string, channels: number, flags: number, run: number, columns: number,
 *   firstSample: number, lostSamples: number, sampleRateHz: number, samplesPerColumn: number,
 *   raw: boolean, low: Float32Array[], high: Float32Array[]}}
 *   `low` and `high`, one array of `columns` values per channel; the same arrays where raw.
 * @throws {RangeError} if it is not such a frame
 */
export function decode(buffer) {
  if (buffer.byteLength < HEADER_BYTES) {
    throw new RangeError(`a frame of ${buffer.byteLength} bytes has no header`);
  }
  const view = new DataView(buffer);
  const version = view.getUint16(0, true);
  const stream = STREAMS[view.getUint16(2, true)];
  const channels = view.getUint16(4, true);
  const columns = view.getUint32(12, true);
  const kind = view.getUint32(44, true);
  if (version !== VERSION) throw new RangeError(`frame version ${version}, not ${VERSION}`);
  if (stream === undefined) throw new RangeError(`no stream ${view.getUint16(2, true)}`);
  if (kind !== RAW && kind !== MIN_MAX) throw new RangeError(`no kind of frame ${kind}`);
  const rows = channels * (kind === RAW ? 1 : 2);
  const expected = HEADER_BYTES + 4 * rows * columns;
  if (buffer.byteLength !== expected) {
    throw new RangeError(`a frame of ${buffer.byteLength} bytes, not ${expected}`);
  }
  const row = (number) => new Float32Array(buffer, HEADER_BYTES + 4 * number * columns, columns);
  const of = (offset, step) => Array.from({ length: channels }, (_, i) => row(step * i + offset));
  const low = kind === RAW ? of(0, 1) : of(0, 2);
  return {
    stream,
    channels,
    columns,
    flags: view.getUint16(6, true),
    run: view.getUint32(8, true),
    firstSample: Number(view.getBigUint64(16, true)),
    lostSamples: Number(view.getBigUint64(24, true)),
    sampleRateHz: view.getFloat64(32, true),
    samplesPerColumn: view.getUint32(40, true),
    raw: kind === RAW,
    low,
    high: kind === RAW ? low : of(1, 2),
  };
}
