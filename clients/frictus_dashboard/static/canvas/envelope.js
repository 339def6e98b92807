/** How a chart paints columns of least and greatest values: as a filled band.
 *
 * Twice as fast as a line through all of them, drawn in software.
 */

/** A band is never thinner, so that a quiet signal is still a line. */
const THIN_PX = 1.5;

/**
 * Paths of a uPlot series whose values are pairs: least, greatest; null where there are none.
 *
 * @param {object} chart
 * @param {number} series its number
 * @returns {object} for uPlot, which fills it with the `fill` of the series
 */
export function envelope(chart, series) {
  const times = chart.data[0];
  const values = chart.data[series];
  const zero = chart.valToPos(0, "y", true);
  const perUnit = chart.valToPos(1, "y", true) - zero;
  const left = chart.valToPos(times[0], "x", true);
  const perPoint = (chart.valToPos(times.at(-1), "x", true) - left) / (times.length - 1);
  const half = (THIN_PX / 2) * devicePixelRatio;
  const fill = new Path2D();
  let begin = 0;
  for (let end = 0; end <= values.length; end += 2) {
    if (end < values.length && values[end] !== null) continue;
    if (begin < end) {
      fill.moveTo(left + perPoint * begin, zero + perUnit * values[begin] + half);
      for (let i = begin; i < end; i += 2) {
        fill.lineTo(left + perPoint * i, zero + perUnit * values[i + 1] - half);
      }
      for (let i = end - 2; i >= begin; i -= 2) {
        fill.lineTo(left + perPoint * i, zero + perUnit * values[i] + half);
      }
      fill.closePath();
    }
    begin = end + 2;
  }
  return { stroke: null, fill, clip: null, band: null, gaps: null, flags: 0 };
}
