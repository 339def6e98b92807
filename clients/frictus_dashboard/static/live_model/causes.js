/** Evidence against the model in force by cause. Pure. */

/** Below it a cause is not shown, nats: odds of less than 3 to 1. */
export const SMALL_NATS = 1;
/** The bars reach so far beyond the alarm line. */
const REACH = 1.6;
/** As many as there is room for. */
const MOST = 4;

/** The id of a cause as words. */
export function titleOf(cause) {
  return cause.replaceAll("_", " ");
}

/**
 * Causes from the most to the least evidence; those that ever alarmed are always among them.
 *
 * @param {object} estimate an EstimateState
 * @returns {{rows: object[], others: number, quiet: boolean, alarmNats: number,
 *   alarmShare: number}} how many are not shown, and whether all of them are below `SMALL_NATS`;
 *   shares are of the length of a bar
 */
export function evidenceOf({ evidence, alarm_nats: alarmNats, alarms, advice }) {
  const sorted = Object.entries(evidence).sort(([, a], [, b]) => b - a);
  const shown = sorted.filter(([cause, nats]) => alarms.includes(cause) || nats >= SMALL_NATS);
  const full = REACH * alarmNats;
  const rows = shown.slice(0, MOST).map(([cause, nats]) => ({
    cause,
    nats,
    title: titleOf(cause),
    alarmed: alarms.includes(cause),
    shared: !alarms.includes(cause) && nats >= alarmNats,
    share: full > 0 ? Math.min(1, Math.max(0, nats / full)) : 0,
    beyond: nats > full,
    where: cause === "unknown" ? (advice.unknown ?? "") : "",
  }));
  const others = sorted.length - rows.length;
  return { rows, others, quiet: shown.length <= MOST, alarmNats, alarmShare: 1 / REACH };
}
