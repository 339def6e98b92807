/** Regions moved and resized by hand, and the lines that their edges snap to. Pure; mm. */

/** As near as this an edge goes to a line. */
const SNAP_MM = 1;
/** Less is a slip of the hand. */
export const LEAST_MM = 1;

/**
 * What edges snap to along an axis: the screen's ends, and the edges of other regions.
 *
 * @param {object[]} others regions
 * @param {"x_mm"|"y_mm"} axis
 * @param {number} end of the screen
 */
export function linesOf(others, axis, end) {
  return [0, end, ...others.flatMap((region) => region[axis])].filter((at) => at >= 0 && at <= end);
}

/** A place on the nearest line, if one is near; else in tenths of a millimetre. */
export function snapped(value, lines) {
  return nearest(value, near(value, lines)) ?? tenths(value);
}

/** From the lesser to the greater of two places, each snapped. */
export function spanned(a, b, lines) {
  return [snapped(Math.min(a, b), lines), snapped(Math.max(a, b), lines)];
}

/**
 * A span moved within the screen; whichever of its edges is nearer to a line snaps.
 *
 * @param {[number, number]} span
 * @param {number} by
 * @param {number[]} lines
 * @param {number} end of the screen
 * @returns {[number, number]}
 */
export function moved([from, to], by, lines, end) {
  const size = to - from;
  const free = Math.min(Math.max(from + by, 0), Math.max(end - size, 0));
  const begins = [0, size].flatMap((edge) => near(free + edge, lines).map((at) => at - edge));
  const begin = nearest(free, begins) ?? free;
  return [tenths(begin), tenths(begin + size)];
}

/**
 * A span with one of its edges somewhere else.
 *
 * @param {[number, number]} span
 * @param {0|1} edge which
 * @param {number} to where
 * @param {number[]} lines
 */
export function resized(span, edge, to, lines) {
  const at = snapped(to, lines);
  return edge === 0
    ? [Math.min(at, span[1] - LEAST_MM), span[1]]
    : [span[0], Math.max(at, span[0] + LEAST_MM)];
}

/**
 * What a hand takes hold of: an edge, a corner or the inside of the uppermost region there.
 *
 * @param {object[]} regions
 * @param {[number, number]} place
 * @param {number} reach of an edge
 * @param {[number, number]} screenMm
 * @returns {{index: number, x: 0|1|null, y: 0|1|null}|null} which edge along each axis
 */
export function gripAt(regions, [x, y], reach, screenMm) {
  for (let index = regions.length - 1; index >= 0; index--) {
    const { x_mm: xs, y_mm: ys } = regions[index];
    // What covers the whole screen is not held: others are drawn on it.
    const within = [xs, ys].every(([from, to], axis) => from >= 0 && to <= screenMm[axis]);
    const near = (at, [from, to]) => at >= from - reach && at <= to + reach;
    if (!within || !near(x, xs) || !near(y, ys)) continue;
    return { index, x: edgeAt(x, xs, reach), y: edgeAt(y, ys, reach) };
  }
  return null;
}

function edgeAt(at, ends, reach) {
  const edge = Math.abs(at - ends[0]) < Math.abs(at - ends[1]) ? 0 : 1;
  return Math.abs(at - ends[edge]) <= reach ? edge : null;
}

function near(value, lines) {
  return lines.filter((line) => Math.abs(line - value) <= SNAP_MM);
}

function nearest(value, places) {
  return places.toSorted((a, b) => Math.abs(a - value) - Math.abs(b - value))[0];
}

function tenths(value) {
  return Math.round(10 * value) / 10;
}
