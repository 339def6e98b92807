/** The screen to scale: the regions of its scene, the finger, and where it was. */

import { colour } from "./colours.js";

const TRAIL_S = 2.0;
/** Steps in which the trail fades. */
const FADES = 8;
const MARGIN_PX = 26;

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
    const perMm = this.#perMm(box.width, box.height);
    const [x, y] = this.#origin(box.width, box.height, perMm);
    return [
      clamp((event.clientX - box.left - x) / perMm, this.screenMm[0]),
      clamp((event.clientY - box.top - y) / perMm, this.screenMm[1]),
    ];
  }

  draw(nowMs) {
    if (this.screenMm === null || this.canvas.width === 0) return;
    const { pen } = this;
    this.ground ??= this.#ground();
    pen.resetTransform();
    pen.clearRect(0, 0, this.canvas.width, this.canvas.height);
    pen.drawImage(this.ground, 0, 0);
    const perMm = this.#place(pen);
    this.#drawTrail(perMm, nowMs);
    this.#drawFinger(perMm);
  }

  #ground() {
    const ground = new OffscreenCanvas(this.canvas.width, this.canvas.height);
    const pen = ground.getContext("2d");
    const perMm = this.#place(pen);
    this.#drawScreen(pen, perMm);
    this.regions.forEach((region, index) => this.#drawRegion(pen, region, index, perMm));
    return ground;
  }

  /** Put a pen's origin at the screen's, in CSS pixels; returns how many are a millimetre. */
  #place(pen) {
    const scale = devicePixelRatio;
    const width = this.canvas.width / scale;
    const height = this.canvas.height / scale;
    const perMm = this.#perMm(width, height);
    pen.setTransform(scale, 0, 0, scale, 0, 0);
    pen.translate(...this.#origin(width, height, perMm));
    return perMm;
  }

  #perMm(width, height) {
    const [x, y] = this.screenMm;
    return Math.min((width - 2 * MARGIN_PX) / x, (height - 2 * MARGIN_PX) / y);
  }

  #origin(width, height, perMm) {
    const [x, y] = this.screenMm;
    return [(width - perMm * x) / 2, (height - perMm * y) / 2];
  }

  #drawScreen(pen, perMm) {
    const [width, height] = this.screenMm;
    pen.fillStyle = colour("--screen");
    pen.strokeStyle = colour("--line");
    pen.lineWidth = 2;
    pen.beginPath();
    pen.roundRect(0, 0, perMm * width, perMm * height, 4);
    pen.fill();
    pen.stroke();
    pen.fillStyle = colour("--quiet");
    pen.font = "13px system-ui, sans-serif";
    pen.textAlign = "center";
    pen.fillText(`${width} mm`, (perMm * width) / 2, perMm * height + 18);
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
    pen.strokeStyle = colour("--region");
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
    const box = this.canvas.getBoundingClientRect();
    const width = Math.round(box.width * devicePixelRatio);
    const height = Math.round(box.height * devicePixelRatio);
    if (this.canvas.width !== width || this.canvas.height !== height) {
      this.canvas.width = width;
      this.canvas.height = height;
      this.ground = null;
    }
  }
}

function clamp(value, end) {
  return Math.min(end, Math.max(0, value));
}
