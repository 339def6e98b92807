/** What a recording holds, and a line that shows all of it in few pixels. */

import { colour } from "../canvas/colours.js";

/** The service takes less than this. */
const MOST_BYTES = 16e6;

/**
 * The samples of a recording, for the eye and the ear: the service reads the file itself.
 *
 * @param {File} file
 * @param {string} suffix wav or csv; of any other nothing is known
 * @param {{channel: number, rateHz: number|null}} how `rateHz` of a single column
 * @returns {Promise<{samples: ArrayLike<number>, rateHz: number}|null>} null: not known
 */
export async function samplesOf(file, suffix, { channel, rateHz }) {
  if (file.size > MOST_BYTES) return null;
  if (suffix === "csv") return columnsOf(await file.text(), rateHz);
  if (suffix !== "wav") return null;
  try {
    const decoder = new OfflineAudioContext(1, 1, 48_000);
    const sound = await decoder.decodeAudioData(await file.arrayBuffer());
    if (!(channel < sound.numberOfChannels)) return null;
    return { samples: sound.getChannelData(channel), rateHz: sound.sampleRate };
  } catch {
    return null; // the service says what is wrong with it
  }
}

/** One column at a given rate, or times and samples. Pure. */
export function columnsOf(text, rateHz) {
  const rows = text.trim().split(/\r?\n/).map((line) => line.split(/[,;\t ]+/).map(Number));
  if (rows[0].some(Number.isNaN)) rows.shift(); // the head
  const width = rows[0]?.length ?? 0;
  const even = rows.every((row) => row.length === width && row.every(Number.isFinite));
  if (!even || rows.length < 2 || width > 2) return null;
  const samples = rows.map((row) => row[width - 1]);
  const rate = width === 1 ? rateHz : (rows.length - 1) / (rows.at(-1)[0] - rows[0][0]);
  return rate > 0 && Number.isFinite(rate) ? { samples, rateHz: rate } : null;
}

/** Least and greatest of the samples in each of some columns. Pure. */
export function extremes(samples, columns) {
  const count = Math.min(columns, samples.length);
  return Array.from({ length: count }, (_, column) => {
    const begin = Math.floor((column * samples.length) / count);
    const end = Math.floor(((column + 1) * samples.length) / count);
    let [least, most] = [samples[begin], samples[begin]];
    for (let i = begin + 1; i < end; i++) {
      least = Math.min(least, samples[i]);
      most = Math.max(most, samples[i]);
    }
    return [least, most];
  });
}

/**
 * Draw samples over the whole of a canvas.
 *
 * @param {HTMLCanvasElement} canvas with as many pixels as its place
 * @param {ArrayLike<number>} samples
 */
export function drawWave(canvas, samples) {
  const { width, height } = canvas;
  const pen = canvas.getContext("2d");
  pen.clearRect(0, 0, width, height);
  const columns = extremes(samples, width);
  const most = columns.reduce((peak, ends) => Math.max(peak, ...ends.map(Math.abs)), 0) || 1;
  const y = (value) => height * (0.5 - (0.45 * value) / most);
  pen.strokeStyle = colour("--trace-1");
  pen.lineWidth = devicePixelRatio;
  pen.beginPath();
  columns.forEach(([low, high], i) => {
    const x = ((i + 0.5) * width) / columns.length;
    pen.lineTo(x, y(low));
    pen.lineTo(x, y(high));
  });
  pen.stroke();
}
