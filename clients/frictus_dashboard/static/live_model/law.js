/** The finger's law and what its interval leaves open. Pure; as `frictus_hardware.physics`. */

/** Speeds at whose ends the law is told; beyond them it is taken as at the end. */
export const SPEEDS_MM_S = [20, 100];
/** What is drawn: the bands of a tracker reach from 40 Hz to 2 kHz. */
export const FREQUENCIES_HZ = Array.from({ length: 81 }, (_, i) => 40 * 50 ** (i / 80));

/** Share of the way from 20 to 100 mm/s. */
function share(speedMmS) {
  const [low, high] = SPEEDS_MM_S;
  return (Math.min(high, Math.max(low, speedMmS)) - low) / (high - low);
}

/** The cutoff at a speed, Hz: a straight line between both ends. */
export function cutoffHz({ cutoff_20_hz: low, cutoff_100_hz: high }, speedMmS) {
  return low + (high - low) * share(speedMmS);
}

/** Friction per full drive, dB re 1 N: |H| = gain / sqrt(1 + (f / cutoff)²). */
export function levelDb(law, hz, speedMmS) {
  return 20 * Math.log10(law.gain_n / Math.hypot(1, hz / cutoffHz(law, speedMmS)));
}

/** The values of a law that is told with intervals. */
export function valuesOf(law) {
  return Object.fromEntries(Object.entries(law).map(([name, { value }]) => [name, value]));
}

/**
 * Half of the 95 % interval of the level, dB: the intervals of gain and both cutoffs carried to
 * first order, as if independent. They are not quite: it is rather too wide than too narrow.
 *
 * @param {object} law a LawNow
 * @param {number} hz
 * @param {number} speedMmS
 */
export function halfWidthDb(law, hz, speedMmS) {
  const along = share(speedMmS);
  const cutoff = cutoffHz(valuesOf(law), speedMmS);
  const ratio = (hz / cutoff) ** 2;
  const slope = ratio / (1 + ratio); // d ln |H| / d ln cutoff
  const low = ((1 - along) * halfWidth(law.cutoff_20_hz)) / cutoff;
  const high = (along * halfWidth(law.cutoff_100_hz)) / cutoff;
  const gain = halfWidth(law.gain_n) / law.gain_n.value;
  return (20 / Math.LN10) * Math.hypot(gain, slope * low, slope * high);
}

function halfWidth({ low, high }) {
  return (high - low) / 2;
}
