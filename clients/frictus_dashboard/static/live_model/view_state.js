/**
 * All that the view shows, made of one estimate and one status: what is said, what is drawn and
 * what stands in bars cannot disagree, and has one age. Pure.
 */

import { policyOf } from "../rig/adaptation.js";
import { STALE_MS } from "../live/estimate_log.js";
import { JND_DB } from "../listening/spectrum.js";
import { evidenceOf } from "./causes.js";
import { headlineOf } from "./headline.js";
import { groupsOf } from "./speed_groups.js";
import { frequency, seconds } from "./units.js";

const ERRORS = { first: "First model", in_force: "Model in force", newest: "Learned now" };
const PROPOSALS = {
  observe: "Under Adapt this would be put in force",
  suggest: "Suggested",
  adapt: "Put in force as it is learned",
};

/**
 * @param {{rig: string|null, status: object|null, estimate: object|null, ageMs: number,
 *   entries: object[]}} heard the newest of each, and the log of estimates
 */
export function viewStateOf({ rig, status, estimate, ageMs, entries }) {
  const state = {
    ...headlineOf(rig, estimate),
    rig,
    estimate,
    entries,
    policy: policyOf(status),
    adaptations: status?.adaptations ?? 0,
    stale: false,
    age: "",
    groups: null,
  };
  if (estimate === null) return state;
  const stale = ageMs > STALE_MS;
  const then = `Last heard ${seconds(Math.floor(ageMs / 1e3), 0)} ago: what is shown is from then`;
  return {
    ...state,
    stale,
    age: stale ? then : "Up to date",
    groups: estimate.law === null ? null : groupsOf(estimate),
    refused: Object.entries(estimate.refused).sort(([, a], [, b]) => b - a),
    evidence: evidenceOf(estimate),
    errors: Object.entries(ERRORS).map(([name, title]) => {
      return { name, title, db: estimate.error_db[name] ?? null };
    }),
    jndDb: JND_DB,
    heldBack: estimate.held_back,
    proposal: proposalOf(policyOf(status), estimate),
    changes: [...estimate.changes].reverse(),
  };
}

/** What would be put in force now, where nothing holds it back; empty else. */
function proposalOf(policy, { law, held_back: heldBack }) {
  if (law === null || heldBack !== "") return "";
  const [at20, at100] = [law.cutoff_20_hz, law.cutoff_100_hz].map(({ value }) => frequency(value));
  const gain = `gain ${law.gain_n.value.toFixed(3)} N`;
  const values = `${gain}, cutoff ${at20} at 20 and ${at100} at 100 mm/s`;
  return `${PROPOSALS[policy]}: ${values}.`;
}
