/** What a calibration measured, over its fit: for a figure, a table and a sentence. Pure. */

import { LOOKS } from "../canvas/measured_points.js";
import { FREQUENCIES_HZ, response } from "../models/law.js";

const decibels = (magnitude) => 20 * Math.log10(magnitude);

/**
 * The slowest, the middle and the fastest speed that was measured, with points and fit.
 *
 * @param {object} diagnostics of a CalibrationResult
 * @param {object} model a `model/1` document of friction
 */
export function groupsOf({ points }, model) {
  const speeds = [...new Set(points.map(({ speed_mm_s: speed }) => speed))];
  const middle = speeds[Math.floor((speeds.length - 1) / 2)];
  const shown = [...new Set([speeds[0], middle, speeds.at(-1)])];
  return shown.map((speedMmS, i) => ({
    ...LOOKS[i],
    speedMmS,
    points: points.filter(({ speed_mm_s: speed }) => speed === speedMmS).map(drawn),
    fit: FREQUENCIES_HZ.map((hz) => response(model, hz, speedMmS).db),
  }));
}

function drawn({ tone_hz: hz, magnitude_n, interval_n: interval }) {
  const db = decibels(magnitude_n);
  const [low, high] = interval === null ? [db, db] : interval.map(decibels);
  return { hz, db, low, high };
}

/** Rows of a table: every point, with what the fit leaves of it. */
export function rowsOf({ points }) {
  return points.map((point) => {
    const { interval_n: interval } = point;
    const residual = decibels(point.magnitude_n / point.fit_n);
    return [
      `${point.speed_mm_s} mm/s, ${point.tone_hz} Hz`,
      String(point.trials),
      point.magnitude_n.toFixed(4),
      interval === null ? "unknown" : interval.map((end) => end.toFixed(4)).join(" to "),
      point.fit_n.toFixed(4),
      signed(residual, 2),
      signed(point.phase_deg - point.fit_phase_deg, 1),
    ];
  });
}

/** How well the law fits, a sentence each. */
export function sentencesOf({ points, residual_db, standardised, held_out: held, note }) {
  const left = `The fit leaves ${residual_db.toFixed(2)} dB (rms) at ${points.length} points`;
  const scatter =
    standardised === null
      ? "; how much scatter alone would leave is not known of so few trials."
      : `, ${standardised.toFixed(1)} times what the scatter of the trials explains${judged(standardised)}.`;
  if (held === null) return [left + scatter, `${note[0].toUpperCase()}${note.slice(1)}.`];
  const unseen =
    `Trials that the fit has not seen are met within ${held.held_out_db.toFixed(2)} dB (rms), ` +
    `those that it has within ${held.in_sample_db.toFixed(2)} dB; the placeholder of a rig ` +
    `that nobody measured misses them by ${held.placeholder_db.toFixed(2)} dB.`;
  return [left + scatter, unseen];
}

/** From twice the scatter on, the shape of the law is to be doubted. */
function judged(standardised) {
  if (standardised < 1.5) return ": the law has the right shape";
  return ": more than chance; look at the points that lie off";
}

function signed(value, digits) {
  const text = value.toFixed(digits);
  return Number(text) === 0 ? text.replace("-", "") : text;
}
