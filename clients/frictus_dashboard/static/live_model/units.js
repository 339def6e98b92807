/** Quantities of the view with their units, as people read them. Pure. */

/** An error in dB: two digits where it is small, as thresholds are. */
export function decibels(db) {
  if (Math.abs(db) < 0.005) return "<0.01 dB";
  return `${db.toFixed(Math.abs(db) < 2 ? 2 : 1)} dB`;
}

/** A frequency in Hz or kHz. */
export function frequency(hz) {
  return hz < 1_000 ? `${hz.toFixed(0)} Hz` : `${(hz / 1_000).toFixed(2)} kHz`;
}

/** A duration in s, min or h. */
export function seconds(s, digits = s < 10 ? 1 : 0) {
  if (s < 90) return `${s.toFixed(digits)} s`;
  return s < 5_400 ? `${(s / 60).toFixed(0)} min` : `${(s / 3_600).toFixed(1)} h`;
}

export function times(count) {
  return count === 1 ? "once" : `${count} times`;
}

/** Evidence or log-likelihood. */
export function nats(value) {
  return `${value.toFixed(Math.abs(value) < 100 ? 1 : 0)} nats`;
}
