/** Measured points by the speed of the finger, and the curves at those speeds. Pure. */

import { LOOKS } from "../canvas/measured_points.js";
import { FREQUENCIES_HZ, halfWidthDb, levelDb, SPEEDS_MM_S, valuesOf } from "./law.js";

/** Slow, medium, fast: up to which speed, and how each is drawn. */
export const GROUPS = [35, 70, Infinity].map((below, i) => ({ below, ...LOOKS[i] }));

/**
 * Points and curves of an estimate; one entry for each of `GROUPS`, null where nothing is shown.
 *
 * Where nothing is measured by speed yet, the curves are those at the ends of the law.
 *
 * @param {object} estimate an EstimateState with a law
 */
export function groupsOf({ law, in_force: inForce, points }) {
  const grouped = GROUPS.map(({ below }, i) => {
    const from = GROUPS[i - 1]?.below ?? 0;
    return points.filter(({ speed_mm_s: speed }) => speed >= from && speed < below);
  });
  const ends = [SPEEDS_MM_S[0], null, SPEEDS_MM_S[1]];
  return GROUPS.map((group, i) => {
    const speedMmS = points.length > 0 ? meanSpeed(grouped[i]) : ends[i];
    if (speedMmS === null) return null;
    const told = valuesOf(law);
    const estimate = FREQUENCIES_HZ.map((hz) => levelDb(told, hz, speedMmS));
    const half = FREQUENCIES_HZ.map((hz) => halfWidthDb(law, hz, speedMmS));
    return {
      ...group,
      speedMmS,
      points: grouped[i].map(measured),
      estimate,
      low: estimate.map((db, k) => db - half[k]),
      high: estimate.map((db, k) => db + half[k]),
      inForce: inForce && FREQUENCIES_HZ.map((hz) => levelDb(inForce, hz, speedMmS)),
    };
  });
}

function meanSpeed(points) {
  if (points.length === 0) return null;
  return points.reduce((sum, point) => sum + point.speed_mm_s, 0) / points.length;
}

function measured({ speed_mm_s: speedMmS, centre_hz: hz, gain_n, half_width_db: half, phase_deg }) {
  const db = 20 * Math.log10(gain_n);
  return { hz, speedMmS, db, low: db - half, high: db + half, half, deg: phase_deg };
}
