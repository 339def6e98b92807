/** What an estimate means in one verdict and a sentence or two. Pure. */

import { JND_DB } from "../listening/spectrum.js";
import { titleOf } from "./causes.js";
import { decibels, frequency, seconds, times } from "./units.js";

/** Windows of 0.1 s that half overlap: each adds this much of sliding, s. */
const WINDOW_S = 0.05;

/**
 * @param {string|null} rig
 * @param {object|null} estimate an EstimateState
 * @returns {{kind: string, verdict: string, sentence: string,
 *   advice: {title: string, text: string}[]}}
 */
export function headlineOf(rig, estimate) {
  if (rig === null) {
    return { kind: "none", verdict: "No rig is present", sentence: "", advice: [] };
  }
  if (estimate === null) return untracked(rig);
  return estimate.law === null ? untouched(estimate) : judged(estimate);
}

function untracked(rig) {
  const sentence = "Start one on the rig's machine: `frictus track`. It learns the finger from " +
    "whatever plays, and says whether the model fits it.";
  return { kind: "none", verdict: `No tracker runs at ${rig}`, sentence, advice: [] };
}

function untouched({ refused }) {
  const [most] = Object.entries(refused).sort(([, a], [, b]) => b - a);
  const why = most === undefined ? "" : ` Left out most often: ${most[0]}.`;
  const sentence = `Play a texture and slide one finger over it at 10 to 150 mm/s.${why}`;
  return { kind: "empty", verdict: "Nothing felt yet", sentence, advice: [] };
}

function judged(estimate) {
  const { law, alarms, advice, error_db: error, windows, new_fingers: fingers } = estimate;
  const at20 = frequency(law.cutoff_20_hz.value);
  const at100 = frequency(law.cutoff_100_hz.value);
  const felt = seconds(windows * WINDOW_S);
  const parts = [`This finger follows the drive up to ${at20} at 20 and ${at100} at 100 mm/s.`];
  if (error.in_force != null && error.newest != null) {
    parts.push(`With this texture the model in force is ${decibels(error.in_force)} off, what ` +
      `was learned in ${felt} ${decibels(error.newest)}.`);
  } else {
    parts.push(`Learned from ${felt} of sliding so far.`);
  }
  if (fingers > 0) parts.push(`Another finger came ${times(fingers)}: learned anew since.`);
  return {
    ...verdictOf(alarms, error.in_force),
    sentence: parts.join(" "),
    advice: alarms.map((cause) => ({ title: titleOf(cause), text: advice[cause] ?? "" })),
  };
}

function verdictOf(alarms, errorDb) {
  if (alarms.length > 0) {
    const named = alarms.filter((cause) => cause !== "unknown").map(titleOf);
    if (alarms.includes("unknown")) named.push("something that no cause explains");
    return { kind: "alarm", verdict: `The model in force is wrong: ${named.join(", ")}` };
  }
  if (errorDb == null) return { kind: "learning", verdict: "Learning this finger" };
  if (errorDb > JND_DB) {
    return { kind: "off", verdict: "The model in force is off by more than a finger can tell" };
  }
  return { kind: "fits", verdict: "The model in force fits this finger" };
}
