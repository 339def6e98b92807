/**
 * All that the strip shows, made of one state with one age: state, holder, figure, marker and
 * verdict cannot disagree. Pure.
 */

import { badgesOf } from "./badges.js";
import { gaugeStateOf } from "./gauge_state.js";
import { nameOf } from "./holder.js";
import { LOSSES } from "./loop_losses.js";

export const SPEED = { name: "Speed", unit: "mm/s", digits: 0, least: 120 };
export const FORCE = { name: "Force", unit: "N", digits: 2, least: 0.8 };
const TITLES = {
  disarmed: "Disarmed",
  armed: "ARMED",
  stopping: "Stopping",
  tripped: "TRIPPED",
};

/**
 * @param {object} heard
 * @param {object|null} heard.status @param {object|null} heard.scene
 * @param {object|null} heard.model @param {object|null} heard.finger the newest of each
 * @param {boolean} heard.trusted whether the rig is there and speaks
 * @param {number} heard.ageMs since its last word
 * @param {string[]} heard.flags of blocks, raised lately
 * @param {string[]} heard.losses counters that grew lately
 * @param {number|null} heard.heldNs UTC since when it is held; null: since before the page came
 * @param {boolean} heard.settling whether the page's lease has begun or ended otherwise than the
 *   status says so far
 * @param {string} heard.client name of this page to the rigs
 * @param {string[]} heard.scopes of its token
 * @returns {object|null} null: nothing is known of a rig
 */
export function stripStateOf(heard) {
  const { status, model, trusted, scopes } = heard;
  if (status === null) return null;
  const finger = trusted && heard.finger?.in_contact ? heard.finger : null;
  const validity = model?.model.validity ?? null;
  const speed = finger === null ? null : Math.hypot(finger.vx_mm_s, finger.vy_mm_s);
  const kind = trusted ? status.state : "unknown";
  return {
    kind,
    title: trusted ? (TITLES[status.state] ?? status.state) : "Unknown",
    stale: !trusted,
    ...(trusted ? whoOf(heard) : pastOf(heard)),
    speed: gaugeStateOf(SPEED, speed, validity?.speed_mm_s ?? null),
    force: gaugeStateOf(FORCE, finger?.normal_force_n ?? null, validity?.normal_force_n ?? null),
    badges: badgesOf({ ...heard, finger }, trusted ? heard.flags : []),
    loop: loopOf(heard),
    fault: trusted && status.fault !== null ? faultOf(status.fault) : "",
    ...actionsOf(heard, trusted ? scopes : []),
  };
}

/** The holder by name, and since when, or who ended the lease before. */
function whoOf({ status, client, heldNs }) {
  const { owner, share_with: shared, last_end: end } = status;
  if (owner !== null) {
    const others = shared.length === 0 ? "" : `, shared with ${shared.join(", ")}`;
    const since = heldNs === null ? "" : `since ${clock(heldNs)}`;
    return { who: `Held by ${nameOf(owner, client)}${others}`, then: since, known: owner };
  }
  if (end === null) return { who: "Held by nobody", then: "", known: "" };
  return { who: "Nobody", then: endOf(end, client), known: "" };
}

/** How a lease ended: by whom, or why, and when. */
export function endOf({ owner, by, reason, utc_ns: ns }, client) {
  const what = reason === "stopped" ? "stopped" : "disarmed";
  if (by === null) return `ended at ${clock(ns)}: ${reason}`;
  const others = by !== owner ? `, held by ${nameOf(owner, client)}` : "";
  return `${what} by ${nameOf(by, client)} at ${clock(ns)}${others}`;
}

function pastOf({ status, ageMs }) {
  const ago = Number.isFinite(ageMs) ? `, ${Math.floor(ageMs / 1e3)} s ago` : "";
  return { who: `It said last: ${status.state}${ago}`, then: "", known: status.owner ?? "" };
}

function loopOf({ trusted, losses }) {
  if (!trusted) return { kind: "unknown", text: "not known" };
  if (losses.length === 0) return { kind: "good", text: "in time" };
  return { kind: "warn", text: losses.map((name) => LOSSES[name]).join(", ") };
}

function faultOf({ kind, reason, action, utc_ns: ns }) {
  return `${clock(ns)} ${kind} fault: ${reason}. ${action}`;
}

function actionsOf({ status, client, settling }, scopes) {
  const tripped = status.state === "tripped";
  const mine = status.owner !== null && status.owner === client;
  return {
    mine,
    arm: {
      hidden: !scopes.includes("render") || tripped,
      disabled: !mine && (status.owner !== null || settling),
      label: mine ? "Disarm" : "Arm",
    },
    sharing: { hidden: !scopes.includes("render") || tripped || status.owner !== null },
    reset: { hidden: !scopes.includes("admin") || !tripped },
  };
}

/** A time of day. @param {number} utcNs nanoseconds since 1970 */
export function clock(utcNs) {
  return new Date(utcNs / 1e6).toTimeString().slice(0, 8);
}
