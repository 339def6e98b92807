/** Responses of base laws. Pure; the same equations as `frictus_hardware.physics`. */

export const FREQUENCIES_HZ = Array.from({ length: 121 }, (_, i) => 10 * 200 ** (i / 120));

/** What a response is relative to, for its level in dB. */
export const UNITS = { first_order_speed: "1 N", mass_spring_damper: "1 m/s per N" };

/** A speed as the law takes it: held at the end of the range in which it was measured. */
export function heldSpeed({ validity }, speedMmS) {
  const [low, high] = validity.speed_mm_s;
  return Math.min(high, Math.max(low, Math.abs(speedMmS)));
}

/** The cutoff at a speed, Hz; null for a law that has none. */
export function cutoffHz(model, speedMmS) {
  const { law, cutoff_0_hz: atRest, slope_hz_per_mm_s: slope } = model.base;
  return law === "first_order_speed" ? atRest + slope * heldSpeed(model, speedMmS) : null;
}

/**
 * The response of the base law, without effects.
 *
 * @param {object} model a `model/1` document
 * @param {number} hz
 * @param {number} speedMmS
 * @returns {{db: number, deg: number}}
 */
export function response(model, hz, speedMmS) {
  const { base } = model;
  if (base.law === "first_order_speed") {
    const ratio = hz / cutoffHz(model, speedMmS);
    return polar(base.gain_n / Math.hypot(1, ratio), -Math.atan(ratio));
  }
  const w = 2 * Math.PI * hz;
  const real = base.stiffness_n_m - base.mass_kg * w * w;
  const imaginary = base.damping_n_s_m * w;
  return polar(w / Math.hypot(real, imaginary), Math.PI / 2 - Math.atan2(imaginary, real));
}

function polar(magnitude, rad) {
  return { db: 20 * Math.log10(magnitude), deg: (180 / Math.PI) * rad };
}
