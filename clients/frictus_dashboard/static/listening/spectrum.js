/** Levels in third octaves. Pure; the same measure as the service's fidelity figures. */

import { power } from "./fourier.js";

/** Third octaves from 31.5 Hz to 1 kHz (IEC 61260, base ten). */
export const CENTRES_HZ = Array.from({ length: 16 }, (_, i) => 10 ** ((i + 15) / 10));
export const NOMINAL_HZ = [
  31.5, 40, 50, 63, 80, 100, 125, 160, 200, 250, 315, 400, 500, 630, 800, 1000,
];
/** Difference threshold of electrovibration amplitude, dB. */
export const JND_DB = 1.21;
/** Bands further than this under the strongest of the target are not judged, dB. */
export const FLOOR_DB = 30;

/**
 * Power in each third octave: mean square of what lies in the band.
 *
 * @param {Float64Array} samples a power of two of them, at least 0.1 s
 * @param {number} sampleRateHz
 * @returns {Float64Array} shape (16,), unit of the samples squared
 */
export function bandPower(samples, sampleRateHz) {
  const n = samples.length;
  const flat = detrended(samples);
  let weight = 0;
  for (let i = 0; i < n; i++) {
    const hann = 0.5 - 0.5 * Math.cos((2 * Math.PI * i) / n);
    weight += hann * hann;
    flat[i] *= hann;
  }
  const bands = new Float64Array(CENTRES_HZ.length);
  power(flat).forEach((square, bin) => {
    const band = Math.floor(10 * Math.log10((bin * sampleRateHz) / n) - 14.5);
    if (band >= 0 && band < bands.length) bands[band] += ((2 / n) * square) / weight;
  });
  return bands;
}

/** Level of each band, dB re 1 N rms; null where there is nothing. */
export function levelsDb(bands) {
  return Array.from(bands, (value) => (value > 0 ? 10 * Math.log10(value) : null));
}

/** Error of the felt level in each band, dB; null where the target is too weak to judge. */
export function errorsDb(felt, target) {
  const floor = Math.max(...target) * 10 ** (-FLOOR_DB / 10);
  return Array.from(target, (wanted, i) =>
    wanted > floor ? 10 * Math.log10(Math.max(felt[i], 1e-30) / wanted) : null,
  );
}

/**
 * What a first-order response would leave of a target, were it not made good.
 *
 * @param {Float64Array} target power per band
 * @param {{cutoff_0_hz: number, slope_hz_per_mm_s: number}} law
 * @param {number} speedMmS
 */
export function uncompensated(target, law, speedMmS) {
  const cutoffHz = law.cutoff_0_hz + law.slope_hz_per_mm_s * Math.abs(speedMmS);
  return target.map((value, i) => value / (1 + (CENTRES_HZ[i] / cutoffHz) ** 2));
}

function detrended(samples) {
  const n = samples.length;
  const middle = (n - 1) / 2;
  let mean = 0;
  let slope = 0;
  for (let i = 0; i < n; i++) {
    mean += samples[i] / n;
    slope += (i - middle) * samples[i];
  }
  slope /= (n * (n * n - 1)) / 12;
  return samples.map((value, i) => value - mean - slope * (i - middle));
}
