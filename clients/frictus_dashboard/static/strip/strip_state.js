/**
 * All that the strip shows, made of one state with one age: state, holder, figure, marker and
 * verdict cannot disagree. Pure.
 */

import { badgesOf } from "./badges.js";
import { clock } from "../elements/figures.js";
import { gaugeStateOf } from "./gauge_state.js";
import { nameOf } from "../rig/holder.js";
import { LOSSES } from "../rig/loop_losses.js";

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
 * @param {boolean} heard.gone whether it is not there, by a service that would see it
 * @param {number} heard.ageMs since its last word
 * @param {string[]} heard.flags of blocks, raised lately
 * @param {string[]} heard.losses counters that grew lately
 * @param {number|null} heard.heldNs UTC since when it is held; null: since before the page came
 * @param {boolean} heard.settling whether the page has asked for a lease, or its lease has begun
 *   or ended otherwise than the status says so far
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
  const told = trusted || hasEnded(heard);
  return {
    kind,
    title: titleOf(heard),
    stale: !trusted,
    ...(told ? whoOf(heard) : pastOf(heard)),
    speed: gaugeStateOf(SPEED, speed, validity?.speed_mm_s ?? null),
    force: gaugeStateOf(FORCE, finger?.normal_force_n ?? null, validity?.normal_force_n ?? null),
    badges: badgesOf({ ...heard, finger }, trusted ? heard.flags : []),
    loop: loopOf(heard),
    fault: told ? faultOf(status, scopes) : "",
    ...actionsOf(heard, trusted ? scopes : []),
  };
}

/** Whether the rig's process has ended: of a rig that is gone its supervisor alone says a trip. */
export function hasEnded({ gone, status }) {
  return gone && status?.state === "tripped";
}

function titleOf(heard) {
  const { trusted, status } = heard;
  if (trusted) return TITLES[status.state] ?? status.state;
  return hasEnded(heard) ? "Ended" : "Unknown";
}

/** The holder by name, and since when, or who ended the lease before, or stopped the rig later. */
function whoOf({ status, client, heldNs }) {
  const { owner, share_with: shared, last_end: end, fault, utc_ns: nowNs } = status;
  if (owner !== null) {
    const names = shared.map((name) => nameOf(name, client));
    const others = names.length === 0 ? "" : `, shared with ${names.join(", ")}`;
    const since = heldNs === null ? "" : `since ${clock(heldNs, nowNs)}`;
    return { who: `Held by ${nameOf(owner, client)}${others}`, then: since, known: owner };
  }
  const stop = stopOfNobody(status);
  if (stop !== null) {
    const then = `stopped by ${nameOf(stop.client, client)} at ${clock(stop.utc_ns, nowNs)}`;
    return { who: "Nobody", then, known: "" };
  }
  if (end === null) return { who: "Held by nobody", then: "", known: "" };
  return { who: "Nobody", then: endOf(end, nowNs, client, fault !== null), known: "" };
}

/** The last stop, if nobody had held the rig since the last lease, as between a job's trials. */
export function stopOfNobody({ owner, last_end: end, last_calls: { stop } = {} }) {
  const ended = end !== null && end.utc_ns >= stop?.utc_ns;
  return stop === undefined || owner !== null || ended ? null : stop;
}

/**
 * How a lease ended: by whom, or why, and when.
 *
 * @param {object} end @param {number} nowNs of the status that says it @param {string} client
 * @param {boolean} told whether the reason stands elsewhere, as that of a trip does
 */
function endOf({ owner, by, reason, utc_ns: ns }, nowNs, client, told) {
  const what = reason === "stopped" ? "stopped" : "disarmed";
  const when = clock(ns, nowNs);
  if (by === null) {
    const why = told ? "" : `: ${reason}`;
    return `held by ${nameOf(owner, client)} until ${when}${why}`;
  }
  const others = by !== owner ? `, held by ${nameOf(owner, client)}` : "";
  return `${what} by ${nameOf(by, client)} at ${when}${others}`;
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

/** What went wrong, when, and what an operator does about it; empty where nothing did. */
function faultOf({ state, fault, utc_ns: nowNs }, scopes) {
  if (fault === null) return "";
  const { kind, reason, action, utc_ns: ns } = fault;
  const wanted = action.includes("reset the rig") && state === "tripped";
  const whose = wanted && !scopes.includes("admin") ? " A reset needs the scope admin." : "";
  return `${clock(ns, nowNs)} ${faultName(kind)}: ${reason}. ${action}${whose}`;
}

/** A kind of fault as people read it: `device_lost` as `device lost fault`. */
export function faultName(kind) {
  return `${kind.replaceAll("_", " ")} fault`;
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
