/** What a fitted law says, with intervals, in words for a table. Pure. */

/** 95 % of a normal distribution, as where models are compared. */
const Z95 = 1.959964;
const PARAMETERS = {
  gain_n: { label: "Gain, N", digits: 4 },
  cutoff_0_hz: { label: "Cutoff at rest, Hz", digits: 0 },
  slope_hz_per_mm_s: { label: "Rise of the cutoff, Hz per mm/s", digits: 2 },
  skew_s: { label: "Delay, µs", digits: 2, per: 1e-6 },
};

/**
 * The parameters of a model; half a 95 % interval where it has a covariance, else null.
 *
 * @param {object} model a `model/1` document of friction
 * @returns {{name: string, label: string, digits: number, value: number, half: number|null}[]}
 */
export function parametersOf(model) {
  const values = { ...model.base, skew_s: model.skew_s };
  return Object.entries(PARAMETERS).map(([name, { label, digits, per = 1 }]) => {
    const at = model.covariance?.parameters.indexOf(name) ?? -1;
    const half = at < 0 ? null : (Z95 * Math.sqrt(model.covariance.matrix[at][at])) / per;
    return { name, label, digits, value: values[name] / per, half };
  });
}

/**
 * The cutoff at the speeds that were measured, with the ends of its 95 % interval, Hz.
 *
 * @param {{speed_mm_s: number, value: number, half_width: number}[]} cutoffs half widths are
 *   relative
 */
export function cutoffsOf(cutoffs) {
  return cutoffs.map(({ speed_mm_s: speed, value, half_width: half }) => {
    return { speed, value, low: value * (1 - half), high: value * (1 + half), half };
  });
}
