/** Which part of the past the traces show: it moves with what comes, or stands. Pure. */

/** So much is kept. */
export const KEPT_S = 600;
export const LEAST_S = 0.02;
export const WINDOWS_S = [1, 2, 10, 60, 600];
const USUAL_S = 2;

export class TimeAxis {
  constructor() {
    this.windowS = USUAL_S;
    this.restart();
  }

  /** Begin anew, with another rig or another run of it. */
  restart() {
    /** When the newest sample was taken, s since the device's first. */
    this.newestS = 0;
    /** The end of what is shown, and the newest sample at the pause; null: it moves. */
    this.endS = 0;
    this.pausedS = null;
  }

  get live() {
    return this.pausedS === null;
  }

  /** What the axis counts from: the newest sample, or that at the pause. */
  get originS() {
    return this.pausedS ?? this.newestS;
  }

  /** What is shown, s from the origin: both at most 0. */
  get range() {
    const end = this.endS - this.originS;
    return [end - this.windowS, end];
  }

  /** Samples up to here have come. */
  advance(newestS) {
    if (newestS < this.newestS) this.restart();
    this.newestS = newestS;
    if (this.live) this.endS = newestS;
  }

  pause() {
    this.pausedS ??= this.newestS;
  }

  resume() {
    this.pausedS = null;
    this.endS = this.newestS;
    if (!WINDOWS_S.includes(this.windowS)) this.windowS = USUAL_S;
  }

  /** Show so much: up to the newest sample while it moves, around the same middle else. */
  show(windowS) {
    this.#place(this.endS + (this.live ? 0 : (windowS - this.windowS) / 2), windowS);
  }

  /** Stand, at what `range` would be then. */
  look([from, to]) {
    this.pause();
    this.#place(this.pausedS + Math.max(from, to), Math.abs(to - from));
  }

  #place(endS, windowS) {
    const newest = this.originS;
    this.windowS = Math.min(KEPT_S, Math.max(LEAST_S, windowS));
    this.endS = Math.min(newest, Math.max(newest - KEPT_S + this.windowS, endS));
  }
}
