import assert from "node:assert/strict";
import { test } from "node:test";

import { decode, encodeUpdate, FrameError, type FingerBatch, type SampleFrame } from "../src/index.js";

const DOCS = `01 00 01 00 01 00 41 00 07 00 00 00 02 00 00 00
90 01 00 00 00 00 00 00 00 00 00 00 00 00 00 00
00 00 00 00 00 88 d3 40 28 00 00 00 01 00 00 00
00 00 fa ed 51 72 86 18 00 00 00 bf 00 00 00 00
00 00 80 3e 00 00 80 3f`;

function bytes(hex: string): Uint8Array<ArrayBuffer> {
  return Uint8Array.from(hex.trim().split(/\s+/), (byte) => parseInt(byte, 16));
}

test("the frame in the docs", () => {
  const frame = decode(bytes(DOCS).buffer) as SampleFrame;
  assert.deepEqual(
    [frame.stream, frame.run, frame.firstSample, frame.lostSamples, frame.samplesPerColumn],
    ["force", 7, 400, 0, 40],
  );
  assert.equal(frame.utcNs, 1_767_225_600_000_000_000n);
  assert.deepEqual([[...frame.low[0]!], [...frame.high[0]!]], [[-0.5, 0], [0.25, 1]]);
});

test("states of the finger", () => {
  const buffer = new ArrayBuffer(56 + 4 * 8 * 2);
  const view = new DataView(buffer);
  for (const [at, value] of [[0, 1], [2, 100], [4, 8]] as const) view.setUint16(at, value, true);
  for (const [at, value] of [[8, 3], [12, 2], [40, 1], [44, 2]] as const) view.setUint32(at, value, true);
  view.setBigUint64(16, 2n ** 40n, true);
  view.setBigUint64(24, 5n, true);
  const rows = [0, 100, 1, 2, 3, 4, 5, 6, 7, 8, 0.5, 0.25, 9, 10, 5, 2];
  rows.forEach((value, at) => view.setFloat32(56 + 4 * at, value, true));
  const batch = decode(buffer) as FingerBatch;
  assert.equal(batch.lostStates, 5);
  assert.deepEqual(batch.states[1], {
    sample: 2 ** 40 + 100,
    xMm: 2,
    yMm: 4,
    vxMmS: 6,
    vyMmS: 8,
    normalForceN: 0.25,
    ageMs: 10,
    inContact: false,
    stale: true,
    extrapolated: false,
  });
  assert.deepEqual([batch.states[0]!.inContact, batch.states[0]!.extrapolated], [true, true]);
});

test("torn frames are refused, newer kinds passed over", () => {
  const whole = bytes(DOCS);
  for (let length = 0; length < whole.length; length++) {
    assert.throws(() => decode(whole.slice(0, length).buffer), FrameError);
  }
  const version = whole.slice();
  version[0] = 2;
  assert.throws(() => decode(version.buffer), /version 2/);
  const stream = whole.slice();
  stream[2] = 9;
  assert.equal(decode(stream.buffer), null);
  const kind = whole.slice();
  kind[44] = 7;
  assert.equal(decode(kind.buffer), null);
});

test("an update is the StreamFrame of the protocol", () => {
  const options = { periodMm: 2.5, angleDeg: 90, ttlMs: 200 };
  const made = new Uint8Array(
    encodeUpdate(9, 3, 1_767_225_600_000_000, [0.1, 0.0, -0.1, 0.0], options),
  );
  // Compared with the document by the Python test that runs these.
  console.log(`update ${Buffer.from(made).toString("hex")}`);
  assert.equal(made.length, 64 + 16);
  for (const wrong of [{}, { periodMm: 1, periodS: 1 }]) {
    assert.throws(() => encodeUpdate(1, 0, 0, [0, 0], wrong), RangeError);
  }
  for (const wrong of [
    { periodMm: 0 },
    { periodMm: 1_001 },
    { periodS: NaN },
    { periodS: 11 },
    { periodMm: 1, angleDeg: 361 },
    { periodMm: 1, ttlMs: 0 },
    { periodMm: 1, ttlMs: 60_001 },
  ]) {
    assert.throws(() => encodeUpdate(1, 0, 0, [0, 0], wrong), RangeError);
  }
  for (const friction of [[], [0], new Float32Array(4097), [0, NaN], [0, Infinity], [0, 10.1]]) {
    assert.throws(() => encodeUpdate(1, 0, 0, friction, { periodMm: 1 }), RangeError);
  }
});
