/** The friction felt lately, sample by sample, and its spectrum beside the target's. */

import { bandPower } from "./spectrum.js";
import { friction, under } from "./target.js";

/** 0.4 s at 20 kHz: long enough for the band at 31.5 Hz. */
const SEGMENT = 8_192;
/** The target is added up at every fourth sample: 5 kHz, its band ends at 1.1 kHz. */
const EVERY = 4;
const STEADY_MM_S = 10;
/** Segments averaged, about 2 s of them. */
const SEGMENTS = 10;
/** So many segments without a slide, 2 s, are more than a turn. */
const RESTING = 5;
const [X, Y, VX, VY, FRICTION] = [0, 1, 2, 3, 4];

export class Felt {
  constructor() {
    this.clear();
  }

  clear() {
    this.run = null;
    /** Device index of the sample that follows those taken; NaN: none was. */
    this.next = NaN;
    this.filled = 0;
    this.samples = Array.from({ length: 5 }, () => new Float64Array(SEGMENT));
    this.segments = [];
    this.why = "Waiting for a finger that slides.";
    this.still = 0;
  }

  /**
   * Take a raw frame of `truth`.
   *
   * @param {object} frame as `frames.decode` returns it
   * @param {{regions: object[], gain: number}|null} scene what it is compared with
   */
  push(frame, scene) {
    // Also where nobody looked for a while: the service counts as lost only what it was to send.
    const follows = frame.run === this.run && frame.firstSample === this.next;
    if (!frame.raw || !follows) this.filled = 0;
    this.run = frame.run;
    this.next = frame.firstSample + frame.columns;
    let taken = 0;
    while (taken < frame.columns) {
      const count = Math.min(SEGMENT - this.filled, frame.columns - taken);
      this.samples.forEach((kept, channel) => {
        kept.set(frame.low[channel].subarray(taken, taken + count), this.filled);
      });
      this.filled += count;
      taken += count;
      if (this.filled < SEGMENT) continue;
      this.#judge(frame.firstSample + taken - SEGMENT, frame.sampleRateHz, scene);
      for (const kept of this.samples) kept.copyWithin(0, SEGMENT / 2);
      this.filled = SEGMENT / 2;
    }
  }

  /** Mean powers per band and mean speed; null until a finger has slid. */
  get spectra() {
    const { segments } = this;
    if (segments.length === 0) return null;
    const mean = (of) => {
      const sum = new Float64Array(segments[0].felt.length);
      for (const segment of segments) {
        segment[of].forEach((value, i) => (sum[i] += value / segments.length));
      }
      return sum;
    };
    const withTarget = segments.every(({ target }) => target !== null);
    const speedMmS = segments.reduce((sum, { speed }) => sum + speed / segments.length, 0);
    return { felt: mean("felt"), target: withTarget ? mean("target") : null, speedMmS };
  }

  #judge(firstSample, sampleRateHz, scene) {
    const samples = this.samples;
    const speed = steadySpeed(samples[VX], samples[VY]);
    if (speed === null) {
      this.still += 1;
      const waiting = "Waiting for a finger that slides for 0.4 s in one direction.";
      const does = moves(samples[VX], samples[VY])
        ? "turns before it has slid for 0.4 s"
        : "does not slide now";
      const rests = `The finger ${does}: this is of its last strokes.`;
      if (this.segments.length === 0) this.why = waiting;
      else this.why = this.still < RESTING ? "" : rests; // between strokes it only turns
      return;
    }
    this.still = 0;
    const felt = bandPower(samples[FRICTION], sampleRateHz);
    let target = null;
    this.why = "";
    if (scene !== null) {
      const path = { x: thinned(samples[X]), y: thinned(samples[Y]) };
      const regions = under(scene.regions, path);
      if (regions === null || regions.length === 0) {
        this.why = regions === null ? "The finger crosses an edge." : "No texture there.";
        return;
      }
      const stepS = EVERY / sampleRateHz;
      const asked = friction(regions, path, firstSample, stepS, sampleRateHz, scene.gain);
      target = bandPower(asked, 1 / stepS);
    }
    if (this.segments.some((other) => (other.target === null) !== (target === null))) {
      this.segments = [];
    }
    this.segments.push({ felt, target, speed });
    if (this.segments.length > SEGMENTS) this.segments.shift();
  }
}

function thinned(samples) {
  return Float64Array.from({ length: samples.length / EVERY }, (_, i) => samples[EVERY * i]);
}

/** Mean speed, mm/s; null where the finger rests or turns. */
function steadySpeed(vx, vy) {
  let along = 0;
  const [headX, headY] = [sum(vx), sum(vy)];
  const norm = Math.hypot(headX, headY);
  if (norm === 0) return null;
  for (let i = 0; i < vx.length; i += 16) {
    along = (vx[i] * headX + vy[i] * headY) / norm;
    if (along < STEADY_MM_S) return null;
  }
  return norm / vx.length;
}

/** Whether it slides at all, though not one way. */
function moves(vx, vy) {
  return vx.some((x, i) => Math.hypot(x, vy[i]) > STEADY_MM_S);
}

function sum(values) {
  let total = 0;
  for (const value of values) total += value;
  return total;
}
