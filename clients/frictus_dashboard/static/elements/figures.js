/** Numbers and moments as people read them. */

const UNKNOWN = "–";

/** A number; a dash where it is not known. */
export function figure(value, digits = 4) {
  return value == null ? UNKNOWN : String(Number(value.toPrecision(digits)));
}

/** An interval; a dash where it is not known. */
export function interval(range, digits = 4) {
  return range == null ? UNKNOWN : range.map((end) => figure(end, digits)).join(" to ");
}

/** A share in per cent; a dash where it is not known. */
export function percent(share) {
  return share == null ? UNKNOWN : `${figure(100 * share, 3)} %`;
}

/** A p value; a dash where it is not known. */
export function probability(p) {
  if (p == null) return UNKNOWN;
  return p < 0.001 ? "< 0.001" : p.toFixed(3);
}

/** A moment in local time; @param {number} utcNs nanoseconds since 1970 */
export function moment(utcNs) {
  const options = { dateStyle: "medium", timeStyle: "short" };
  return new Date(utcNs / 1e6).toLocaleString(undefined, options);
}

/**
 * A time of day, with the date where that is another one.
 *
 * @param {number} utcNs nanoseconds since 1970
 * @param {number} nowNs likewise, by the same clock: that of the browser may be another
 */
export function clock(utcNs, nowNs = utcNs) {
  const [then, now] = [utcNs, nowNs].map((ns) => new Date(ns / 1e6));
  const time = then.toTimeString().slice(0, 8);
  if (then.toDateString() === now.toDateString()) return time;
  return `${then.toLocaleDateString(undefined, { day: "numeric", month: "short" })}, ${time}`;
}
