/** The log of estimates as columns, marks and ranges of a chart over time. Pure. */

const SPANS_S = [60, 120, 300, 600];
/** Longer between two estimates, and the line is broken, s. */
const GAP_S = 5;
/** Least half height of a chart, as a share of the value: noise is not blown up. */
const LEAST_SHARE = 0.04;

/** How far back the axis reaches, s: no further than there is something to show. */
export function axisSpanS(entries, nowS) {
  const covered = entries.length === 0 ? 0 : nowS - entries[0].s;
  return SPANS_S.find((span) => covered <= span) ?? SPANS_S.at(-1);
}

/**
 * Columns of one parameter: seconds before now, upper and lower end, value, model in force.
 *
 * @param {object[]} entries of an `EstimateLog`
 * @param {string} name of a parameter of the law
 * @param {number} nowS by the clock of the entries
 */
export function columnsOf(entries, name, nowS) {
  const columns = [[], [], [], [], []];
  const push = (...row) => row.forEach((each, i) => columns[i].push(each));
  entries.forEach(({ s, law, inForce, anew }, i) => {
    const broken = i > 0 && (anew || s - entries[i - 1].s > GAP_S);
    if (broken) push((entries[i - 1].s + s) / 2 - nowS, null, null, null, null);
    const { value, low, high } = law[name];
    push(s - nowS, high, low, value, inForce?.[name] ?? null);
  });
  return columns;
}

/** When the model was changed, seconds before now, within the span of the axis. */
export function marksOf(estimate, entries, nowS) {
  const span = axisSpanS(entries, nowS);
  const changes = estimate?.changes ?? [];
  return changes.map(({ utc_ns: ns }) => ns / 1e9 - nowS).filter((s) => s >= -span && s <= 0);
}

/**
 * The range of the vertical axis: all values, the model in force and the newest interval. What
 * was not known yet at the beginning would leave no room for what is.
 */
export function rangeOf([, high, low, value, inForce]) {
  const last = value.length - 1;
  if (last < 0) return [0, 1];
  const all = [...value, ...inForce, high[last], low[last]].filter((each) => each !== null);
  const least = Math.min(...all);
  const most = Math.max(...all);
  const middle = (least + most) / 2;
  const half = Math.max(0.6 * (most - least), LEAST_SHARE * Math.abs(middle));
  return [middle - half, middle + half];
}
