/** What a calibration is good for, and what would make it more precise: a sentence each. Pure. */

import { figure, interval } from "../elements/figures.js";
import { JND_DB } from "../listening/spectrum.js";

/** @param {object} calibration one that has a result */
export function adviceOf({ participant, spec: { protocol }, result }) {
  return [known(result), goodFor(participant, result), narrower(protocol, result)];
}

function known({ precision, reached }) {
  const asked = `what was asked for is ${reached ? "" : "not "}reached`;
  return `The cutoff is known within ${(100 * precision).toFixed(1)} % at every speed; ${asked}.`;
}

/** By trials that the fit has not seen; where none were held out, only where it was measured. */
function goodFor(participant, { model: { validity }, details: { diagnostics } }) {
  const { speed_mm_s: speeds, normal_force_n: forces } = validity ?? {};
  const range = `${measured(speeds)} mm/s and ${measured(forces)} N`;
  const db = diagnostics?.held_out?.held_out_db;
  if (db === undefined) {
    return `It is good for textures under ${participant}'s finger at ${range}; how close they ` +
      "come to what is asked for is not known of so few trials.";
  }
  const people = db < JND_DB ? "which people do not feel" : "which people can feel";
  return `With it, friction under ${participant}'s finger comes within ${db.toFixed(2)} dB (rms) of ` +
    `what a texture asks for at ${range}, ${people} (from ${JND_DB} dB on).`;
}

/** Ends of what was measured; of one value alone that. */
function measured(ends) {
  return ends?.[0] === ends?.[1] ? figure(ends?.[0]) : interval(ends);
}

/** Intervals shrink with the root of what is recorded. */
function narrower({ kind, precision: wanted }, { precision, recorded_s: recordedS, reached }) {
  if (kind === "paper") {
    return "About four times as many trials halve the interval: more tones, speeds or forces in Settings.";
  }
  const aim = reached ? precision / 2 : wanted;
  const seconds = figure(recordedS * (precision / aim) ** 2, 2);
  return `About ${seconds} s recorded in place of ${recordedS.toFixed(0)} s narrow it to ` +
    `${figure(100 * aim, 2)} %: a new calibration, with that as Precision and Longest recording in Settings.`;
}
