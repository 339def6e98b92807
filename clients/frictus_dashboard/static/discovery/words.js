/** What a discovery says, in words. Pure. */

import { figure, interval } from "../elements/figures.js";

/** How effects write that a parameter is a plain number. */
const NO_UNIT = "1";
const STATES = {
  queued: "Waits for its turn",
  running: "Runs",
  interrupted: "Interrupted: the service ended; start it again",
  cancelled: "Cancelled",
  failed: "Failed",
  done: "Done",
};
const VERDICTS = {
  clean: "Clean: nothing reproducible is wrong",
  explained: "Explained",
  partly_explained: "Partly explained",
  characterised: "Characterised: no known cause, but its form",
  unexplained: "Unexplained",
};
const FOUND = {
  confirmed: "confirmed: the catalogue's shape fits",
  family: "family: of this kind, of another shape than the catalogue's",
};

export const ACTIVE = ["queued", "running"];

/** The id of a cause as words. */
export function titleOf(id) {
  return id.replaceAll("_", " ");
}

export function stateOf(job) {
  return STATES[job.state];
}

export function verdictOf(verdict) {
  return verdict === null ? "Nothing could be tested" : VERDICTS[verdict];
}

/** The verdict of a discovery; of one recording, which is ranked without a test, what that said. */
export function headlineOf({ verdict, one_recording: one = null }) {
  if (verdict !== null || one === null) return verdictOf(verdict);
  return `One recording: ${one.beyond_threshold ? "causes are ranked" : "nothing beyond chance"}`;
}

/** A model of one recording by its causes and their sizes. */
export function modelOf({ causes, parameters }) {
  const named = causes.map((id) => {
    return `${titleOf(id)} (${parametersOf({ parameters: parameters[id] }).join(", ")})`;
  });
  return named.join("; ") || "base model alone";
}

/** How surely a cause is named. */
export function surenessOf({ verdict }) {
  return FOUND[verdict];
}

/** Which study, or studies, were asked about. */
export function studyOf({ study }) {
  return [study].flat().join(", ");
}

/** Which model is criticised. */
export function baseOf({ base }) {
  if (typeof base === "string") return base;
  return `a model of ${base.participant ?? "the population"}`;
}

/** Parameters with intervals and units, one text each. */
export function parametersOf({ parameters }) {
  return Object.entries(parameters).map(([name, { value, ci95, unit }]) => {
    const span = ci95 === null ? "" : ` (95 %: ${interval(ci95)})`;
    return `${name} ${figure(value)}${unit === NO_UNIT ? "" : ` ${unit}`}${span}`;
  });
}

/** By how much data are predicted better that were not used to fit. */
export function gainOf({ heldout_loglik: gain, ci95, residual_db: db, residual_deg: deg }) {
  const span = ci95 === null ? "" : ` (95 %: ${interval(ci95, 3)})`;
  const [before, after] = db.map((size, i) => `${figure(size, 2)} dB and ${figure(deg[i], 2)}°`);
  const left = `what is left there: ${before} before, ${after} after`;
  return `Log-likelihood of held-out data ${figure(gain, 3)} nats${span}; ${left}.`;
}

/** The gain of one cause in nats, or why it has none. */
export function briefGainOf({ gain }) {
  if (gain === null) return "none: not in the extended model";
  const span = gain.ci95 === null ? "" : ` (${interval(gain.ci95, 3)})`;
  return `${figure(gain.heldout_loglik, 3)}${span}`;
}

/** What came of a cause of the catalogue. */
export function resultOf({ id, not_tested: why }, { causes, cannot_tell: unsure }) {
  if (why !== null) return `not tested: ${why}`;
  if (causes.some((cause) => cause.id === id)) return "named";
  return unsure.some(({ between }) => between.includes(id)) ? "cannot tell" : "not found";
}
