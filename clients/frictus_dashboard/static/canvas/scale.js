/** A screen drawn to scale in the middle of a canvas, in CSS pixels. */

import { colour } from "./colours.js";

/** Around the screen, for its sizes. */
const MARGIN_PX = 26;

/** Give a canvas the pixels of its place; whether that changed, and with it lost its picture. */
export function fitted(canvas) {
  const box = canvas.getBoundingClientRect();
  const width = Math.round(box.width * devicePixelRatio);
  const height = Math.round(box.height * devicePixelRatio);
  if (canvas.width === width && canvas.height === height) return false;
  canvas.width = width;
  canvas.height = height;
  return true;
}

/**
 * Where the screen lies in a place.
 *
 * @param {number} width of the place, CSS pixels
 * @param {number} height
 * @param {[number, number]} screenMm width and height
 * @returns {{perMm: number, left: number, top: number}} CSS pixels
 */
export function laid(width, height, [widthMm, heightMm]) {
  const room = [width - 2 * MARGIN_PX, height - 2 * MARGIN_PX];
  const perMm = Math.min(room[0] / widthMm, room[1] / heightMm);
  return { perMm, left: (width - perMm * widthMm) / 2, top: (height - perMm * heightMm) / 2 };
}

/**
 * Put a pen's origin at the screen's.
 *
 * @returns {number} CSS pixels per millimetre; not positive where there is no room
 */
export function toScale(pen, screenMm) {
  const scale = devicePixelRatio;
  const { width, height } = pen.canvas;
  const { perMm, left, top } = laid(width / scale, height / scale, screenMm);
  pen.setTransform(scale, 0, 0, scale, 0, 0);
  pen.translate(left, top);
  return perMm;
}

/** Draw the screen itself, and how wide it is. */
export function outline(pen, [widthMm, heightMm], perMm) {
  pen.fillStyle = colour("--screen");
  pen.strokeStyle = colour("--line");
  pen.lineWidth = 2;
  pen.beginPath();
  pen.roundRect(0, 0, perMm * widthMm, perMm * heightMm, 4);
  pen.fill();
  pen.stroke();
  pen.fillStyle = colour("--quiet");
  pen.font = "13px system-ui, sans-serif";
  pen.textAlign = "center";
  pen.fillText(`${widthMm} mm`, (perMm * widthMm) / 2, perMm * heightMm + 18);
}
