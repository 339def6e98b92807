/** One quantity against the range in which the model is valid: figure, marker and verdict. Pure. */

const NONE = "–";

/**
 * All that a gauge shows, made of one value: the figure, the marker and the verdict agree.
 *
 * @param {{unit: string, digits: number, least: number}} what `least`: the scale reaches so far
 * @param {number|null} value null: the finger does not touch, or it is not known
 * @param {[number, number]|null} range in which the model is valid; null: not known
 * @returns {{figure: string, verdict: string, words: string, mark: number|null,
 *   zone: [number, number]|null}} `mark` and `zone` as shares of the scale
 */
export function gaugeStateOf(what, value, range) {
  const full = Math.max(what.least, range === null ? 0 : 1.5 * range[1]);
  const share = (place) => Math.min(1, Math.max(0, place / full));
  // What is judged is what is read: 100.3 mm/s is shown, and valid, as 100 mm/s.
  const read = value === null ? null : Number(value.toFixed(what.digits));
  const verdict = judged(read, range);
  return {
    figure: read === null ? NONE : read.toFixed(what.digits),
    verdict,
    words: sentence(verdict, range, what.unit),
    mark: read === null ? null : share(read),
    zone: range === null ? null : range.map(share),
  };
}

/** Where one value was measured, nobody knows how far from it the model still holds. */
function judged(value, range) {
  if (value === null) return "none";
  if (range === null || range[0] === range[1]) return "unknown";
  if (value < range[0]) return "below";
  return value > range[1] ? "above" : "inside";
}

function sentence(verdict, range, unit) {
  if (range === null) return "Valid range not known yet";
  if (range[0] === range[1]) return `Measured at ${range[0]} ${unit} only`;
  const valid = `${range[0]} to ${range[1]} ${unit}`;
  const marks = { none: "valid", inside: "✓ valid", below: "▼ below", above: "▲ above" };
  return `${marks[verdict]} ${valid}`;
}
