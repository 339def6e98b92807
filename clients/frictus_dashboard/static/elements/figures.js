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
