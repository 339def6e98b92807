/** Binary frames of /v1/live: samples and states in, texture updates out. Pure. */

export const STREAMS = ["force", "accel", "voltage", "truth", "aux", "render"] as const;
export type StreamName = (typeof STREAMS)[number];

const HEADER_BYTES = 56;
const VERSION = 1;
const RAW = 0;
const EXTREMES = 1;
const FINGER = 2;
const FINGER_ROWS = 8;

/** Columns of one stream that follow one another without a gap. */
export interface SampleFrame {
  stream: StreamName;
  /** Bits of all blocks in it: 1 armed, 2 clipped, 4 scaled; docs/protocol.md has all. */
  flags: number;
  /** Of the rig; sample counts begin again with it. */
  run: number;
  /** Device index of the first sample. */
  firstSample: number;
  /** Missing between the frame before of this stream and this one. */
  lostSamples: number;
  sampleRateHz: number;
  samplesPerColumn: number;
  columns: number;
  /** UTC of the first sample by the rig's clock, ns since 1970: more digits than a number has. */
  utcNs: bigint;
  /** Per channel the samples, or the least of each column. N, m/s², V. */
  low: Float32Array[];
  /** Per channel the greatest of each column; the same arrays as `low` where samples are raw. */
  high: Float32Array[];
}

/** What the sensors say of the finger, once a block. */
export interface FingerState {
  /** Device sample index this state holds for. */
  sample: number;
  xMm: number;
  yMm: number;
  vxMmS: number;
  vyMmS: number;
  normalForceN: number;
  /** Age of the touch report behind it. */
  ageMs: number;
  inContact: boolean;
  stale: boolean;
  extrapolated: boolean;
}

/** All states of the finger since the batch before. */
export interface FingerBatch {
  run: number;
  /** Missing before this batch. */
  lostStates: number;
  sampleRateHz: number;
  /** UTC of the first state by the rig's clock, ns since 1970. */
  utcNs: bigint;
  states: FingerState[];
}

/** Bytes are not a frame of this version; the text says which field and why. */
export class FrameError extends RangeError {}

/**
 * Read a binary frame; null for one of a later version's streams or kinds, to be passed over.
 * @throws FrameError if it is torn or of another version
 */
export function decode(buffer: ArrayBuffer): SampleFrame | FingerBatch | null {
  if (buffer.byteLength < HEADER_BYTES) {
    throw new FrameError(`${buffer.byteLength} bytes: the header alone takes ${HEADER_BYTES}`);
  }
  const view = new DataView(buffer);
  const version = view.getUint16(0, true);
  if (version !== VERSION) throw new FrameError(`frame version ${version}: ${VERSION} is known`);
  const stream = STREAMS[view.getUint16(2, true) - 1];
  const channels = view.getUint16(4, true);
  const columns = view.getUint32(12, true);
  const kind = view.getUint32(44, true);
  if (kind > FINGER || (kind !== FINGER && stream === undefined)) return null;
  const rows = channels * (kind === EXTREMES ? 2 : 1);
  const expected = HEADER_BYTES + 4 * rows * columns;
  if (buffer.byteLength !== expected) {
    throw new FrameError(`${buffer.byteLength} bytes: ${columns} columns take ${expected}`);
  }
  const row = (index: number) => new Float32Array(buffer, HEADER_BYTES + 4 * index * columns, columns);
  const common = {
    run: view.getUint32(8, true),
    sampleRateHz: view.getFloat64(32, true),
    utcNs: view.getBigUint64(48, true),
  };
  const firstSample = Number(view.getBigUint64(16, true));
  const lost = Number(view.getBigUint64(24, true));
  if (kind === FINGER) {
    if (channels < FINGER_ROWS) throw new FrameError(`${channels} channels of the finger, not 8`);
    return { ...common, lostStates: lost, states: statesOf(firstSample, columns, row) };
  }
  const of = (offset: number, step: number) =>
    Array.from({ length: channels }, (_, channel) => row(step * channel + offset));
  const low = kind === RAW ? of(0, 1) : of(0, 2);
  return {
    ...common,
    stream: stream as StreamName,
    flags: view.getUint16(6, true),
    firstSample,
    lostSamples: lost,
    samplesPerColumn: view.getUint32(40, true),
    columns,
    low,
    high: kind === RAW ? low : of(1, 2),
  };
}

function statesOf(
  firstSample: number,
  count: number,
  row: (index: number) => Float32Array,
): FingerState[] {
  const rows = Array.from({ length: FINGER_ROWS }, (_, index) => row(index));
  const at = (index: number, column: number) => rows[index]![column]!;
  return Array.from({ length: count }, (_, column) => {
    const flags = at(7, column);
    return {
      sample: firstSample + at(0, column),
      xMm: at(1, column),
      yMm: at(2, column),
      vxMmS: at(3, column),
      vyMmS: at(4, column),
      normalForceN: at(5, column),
      ageMs: at(6, column),
      inContact: (flags & 1) !== 0,
      stale: (flags & 2) !== 0,
      extrapolated: (flags & 4) !== 0,
    };
  });
}

/** How an update of a texture stream is to be played; give one period. */
export interface UpdateOptions {
  /** Length of the period over position, up to 1000 mm. */
  periodMm?: number;
  /** Length of the period over time, up to 10 s. */
  periodS?: number;
  /** Direction of a spatial texture's phase, from x towards y; 0. */
  angleDeg?: number;
  /** For how long the rig may still take it, ms from now; 200. */
  ttlMs?: number;
}

const UPDATE_HEADER_BYTES = 64;
const MAX_SAMPLES = 4096;
const MAX_FRICTION_N = 10;
const MAX_TTL_MS = 60_000;

/**
 * Return the bytes of one update: one period of friction, N, 2 to 4096 samples.
 * @throws RangeError if a value is out of range or not finite
 */
export function encodeUpdate(
  ticket: number,
  sequence: number,
  utcUs: number,
  frictionN: ArrayLike<number>,
  options: UpdateOptions,
): ArrayBuffer {
  const { periodMm, periodS, angleDeg = 0, ttlMs = 200 } = options;
  if ((periodMm === undefined) === (periodS === undefined)) {
    throw new RangeError("give either periodMm or periodS, not both and not neither");
  }
  const count = frictionN.length;
  if (count < 2 || count > MAX_SAMPLES) {
    throw new RangeError(`${count} samples: 2 to ${MAX_SAMPLES} are one period`);
  }
  // The service ends the connection, and with it the lease, over what is out of range.
  within("periodMm", periodMm ?? 1, 1e-3, 1_000);
  within("periodS", periodS ?? 1, 1e-4, 10);
  within("angleDeg", angleDeg, -360, 360);
  within("ttlMs", ttlMs, 1, MAX_TTL_MS);
  const buffer = new ArrayBuffer(UPDATE_HEADER_BYTES + 4 * count);
  const view = new DataView(buffer);
  [..."FRTX"].forEach((letter, at) => view.setUint8(at, letter.charCodeAt(0)));
  view.setUint16(4, 1, true);
  view.setUint16(6, periodMm === undefined ? 1 : 0, true);
  view.setUint32(8, ticket, true);
  view.setUint32(12, count, true);
  view.setBigUint64(16, BigInt(sequence), true);
  view.setBigInt64(24, BigInt(Math.round(utcUs)) * 1000n, true);
  view.setUint32(32, ttlMs, true);
  view.setFloat64(40, (periodMm ?? periodS) as number, true);
  view.setFloat64(48, angleDeg, true);
  for (let index = 0; index < count; index++) {
    const value = frictionN[index]!;
    within("friction", value, -MAX_FRICTION_N, MAX_FRICTION_N);
    view.setFloat32(UPDATE_HEADER_BYTES + 4 * index, value, true);
  }
  return buffer;
}

/** @throws RangeError if a value is out of range or not finite */
export function within(name: string, value: number, low: number, high: number): void {
  if (value >= low && value <= high) return; // NaN is not
  throw new RangeError(`${name} ${value}: ${low} to ${high} accepted`);
}
