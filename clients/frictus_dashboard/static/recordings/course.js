/** How a recording went, in words and numbers for a figure. Pure. */

/** By signal, in the order in which they are drawn. */
export const TITLES = {
  lateral_force: "Lateral force",
  normal_force: "Normal force",
  speed: "Speed of the finger",
  screen_voltage: "Voltage on the screen",
};

/** The middles of the columns, s. @param {object} course as the service tells it */
export function timesOf({ column_s: width, signals }) {
  return signals[0].low.map((_, i) => (i + 0.5) * width);
}

/** From where to where a signal goes, in words. */
export function extentOf({ unit, low, high }) {
  const known = (ends) => ends.filter((end) => end !== null);
  const [least, most] = [Math.min(...known(low)), Math.max(...known(high))];
  if (!Number.isFinite(least)) return "not recorded";
  return `${figures(least)} to ${figures(most)} ${unit}`;
}

/** What happened, a line each. */
export function eventsOf({ events, left_out: more }) {
  const lines = events.map(({ at_s: s, what }) => `${s.toFixed(2)} s: ${what}`);
  return more === 0 ? lines : [...lines, `and ${more} more`];
}

/** Three figures are enough to read. */
function figures(value) {
  return String(Number(value.toPrecision(3)));
}
