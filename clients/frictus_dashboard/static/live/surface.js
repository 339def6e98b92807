/** The screen to scale: the regions of its scene, the finger, and where it was. */

import { colour } from "../canvas/colours.js";
import { fitted, laid, outline, toScale } from "../canvas/scale.js";

const TRAIL_S = 2.0;
/** Steps in which the trail fades. */
const FADES = 8;

const COLOURS = 6;

/** The custom property of a region's colour. @param {number} index from 0 */
export function regionColour(index) {
  return `--region-${(index % COLOURS) + 1}`;
}

export class Surface {
  /** @param {HTMLCanvasElement} canvas */
  constructor(canvas) {
    this.canvas = canvas;
    this.pen = canvas.getContext("2d");
    this.screenMm = null;
    this.regions = [];
    /** Screen and regions, kept as drawn: they change seldom, the finger sixty times a second. */
    this.ground = null;
    this.trail = [];
    this.finger = null;
    new ResizeObserver(() => this.#fit()).observe(canvas);
  }

  /** @param {[number, number]} screenMm width and height */
  setScreen(screenMm) {
    if (String(screenMm) === String(this.screenMm)) return;
    this.screenMm = screenMm;
    this.canvas.style.aspectRatio = `${screenMm[0]} / ${screenMm[1]}`;
    this.trail = [];
    this.ground = null;
    this.#fit();
  }

  /** @param {object[]} regions of the scene; none where it is not known */
  setRegions(regions) {
    this.regions = regions;
    this.ground = null;
  }

  /** Draw anew, in the colours of now. */
  redraw() {
    this.ground = null;
  }

  /** @param {object|null} finger a FingerState; null: not known any more */
  setFinger(finger, nowMs) {
    const { trail } = this;
    this.finger = finger;
    if (finger?.in_contact) trail.push([finger.x_mm, finger.y_mm, nowMs]);
    else if (trail.at(-1)) trail.push(null); // lifted: the line breaks here
    while (trail.length && (finger === null || (trail[0]?.[2] ?? 0) < nowMs - 1_000 * TRAIL_S)) {
      trail.shift();
    }
  }

  /** Where a pointer is, mm. */
  place(event) {
    const box = this.canvas.getBoundingClientRect();
    const { perMm, left, top } = laid(box.width, box.height, this.screenMm);
    return [
      clamp((event.clientX - box.left - left) / perMm, this.screenMm[0]),
      clamp((event.clientY - box.top - top) / perMm, this.screenMm[1]),
    ];
  }

  draw(nowMs) {
    if (this.screenMm === null || this.canvas.width === 0) return;
    const { pen } = this;
    this.ground ??= this.#ground();
    pen.resetTransform();
    pen.clearRect(0, 0, this.canvas.width, this.canvas.height);
    pen.drawImage(this.ground, 0, 0);
    const perMm = toScale(pen, this.screenMm);
    this.#drawTrail(perMm, nowMs);
    this.#drawFinger(perMm);
  }

  #ground() {
    const ground = new OffscreenCanvas(this.canvas.width, this.canvas.height);
    const pen = ground.getContext("2d");
    const perMm = toScale(pen, this.screenMm);
    this.#drawScreen(pen, perMm);
    this.regions.forEach((region, index) => this.#drawRegion(pen, region, index, perMm));
    return ground;
  }

  #drawScreen(pen, perMm) {
    const height = this.screenMm[1];
    outline(pen, this.screenMm, perMm);
    pen.save();
    pen.translate(-9, (perMm * height) / 2);
    pen.rotate(-Math.PI / 2);
    pen.fillText(`${height} mm`, 0, 0);
    pen.restore();
  }

  #drawRegion(pen, region, index, perMm) {
    const [x, xEnd] = region.x_mm.map((value) => perMm * clamp(value, this.screenMm[0]));
    const [y, yEnd] = region.y_mm.map((value) => perMm * clamp(value, this.screenMm[1]));
    pen.save();
    pen.beginPath();
    pen.rect(x, y, xEnd - x, yEnd - y);
    pen.clip();
    pen.strokeStyle = colour(regionColour(index));
    pen.lineWidth = 1;
    pen.beginPath();
    for (let at = x - (yEnd - y); at < xEnd; at += 9) {
      pen.moveTo(at, yEnd);
      pen.lineTo(at + (yEnd - y), y);
    }
    pen.stroke();
    pen.lineWidth = 3;
    pen.strokeRect(x, y, xEnd - x, yEnd - y);
    pen.restore();
    pen.font = "600 13px system-ui, sans-serif";
    pen.textAlign = "left";
    const name = region.name || `Region ${index + 1}: ${region.texture.kind}`;
    pen.fillStyle = colour("--screen");
    pen.fillRect(x + 4, y + 4, pen.measureText(name).width + 8, 19);
    pen.fillStyle = colour("--ink");
    pen.fillText(name, x + 8, y + 18);
  }

  #drawTrail(perMm, nowMs) {
    const { pen, trail } = this;
    pen.strokeStyle = colour("--finger");
    pen.lineWidth = 3;
    pen.lineCap = "round";
    for (let older = 0; older < FADES; older++) {
      const [from, to] = [older, older + 1].map((i) => nowMs - (1_000 * TRAIL_S * i) / FADES);
      pen.globalAlpha = 1 - (older + 0.5) / FADES;
      pen.beginPath();
      trail.forEach((end, i) => {
        const begin = trail[i - 1];
        if (!begin || !end || end[2] > from || end[2] <= to) return;
        pen.moveTo(perMm * begin[0], perMm * begin[1]);
        pen.lineTo(perMm * end[0], perMm * end[1]);
      });
      pen.stroke();
    }
    pen.globalAlpha = 1;
  }

  #drawFinger(perMm) {
    const { pen, finger } = this;
    if (finger === null) return;
    pen.fillStyle = colour(finger.stale ? "--quiet" : "--finger");
    pen.strokeStyle = colour("--screen");
    pen.lineWidth = 3;
    pen.beginPath();
    pen.arc(perMm * finger.x_mm, perMm * finger.y_mm, 11, 0, 2 * Math.PI);
    if (finger.in_contact) pen.fill();
    else pen.strokeStyle = colour("--quiet");
    pen.stroke();
  }

  #fit() {
    if (fitted(this.canvas)) this.ground = null;
  }
}

function clamp(value, end) {
  return Math.min(end, Math.max(0, value));
}
