/** Who holds a rig, by a name that people know, and whom that keeps from changing what is felt. */

import { TAB } from "../storage.js";

/** Names that services and programs are given, as `spoken_name` of frictus.keys reads them. */
const PAGE = /^(.+)\.page-[0-9a-f]{6}$/;
const PARTICIPANT = /\.participant-[0-9a-f]{6}$/;
const REST = /^(.+)\.rest$/;
const JOB = /^(.+)\.(calibration|experiment)-[0-9a-f]+$/;
const PROGRAM = /^(.+)-\d+-[0-9a-f]{6}$/;
/** Whom everybody acts for where the service asks for no tokens. */
const ANYBODY = "local";
const ARTICLES = { calibration: "a calibration", experiment: "an experiment" };

/** Names that this tab has had, before it was loaded anew too: each connection has one of its own. */
const KEPT_AS = "frictus-own-clients";
const MOST_KEPT = 20;
const OWN = new Set(TAB.getItem(KEPT_AS)?.split("\n"));

/** Know a client as this page, also once its connection is lost and another has a new name. */
export function knowAsOwn(client) {
  OWN.add(client);
  TAB.setItem(KEPT_AS, [...OWN].slice(-MOST_KEPT).join("\n"));
}

/** Whether a client is a calibration or an experiment. */
export function isJob(owner) {
  return JOB.test(owner);
}

/**
 * Whether a rig has another holder than before. A calibration or an experiment lets it go between
 * its trials, and goes on holding it all the same.
 *
 * @param {object} before @param {object} after two statuses of the rig
 */
export function takesRig(before, after) {
  if (after.owner === null || after.owner === before.owner) return false;
  return !isJob(after.owner) || after.owner !== before.last_end?.owner;
}

/**
 * A client as people know it.
 *
 * @param {string|null} owner its name to the rigs; null: there is none
 * @param {string} client name of this page
 */
export function nameOf(owner, client) {
  if (owner === null) return "nobody";
  if (owner === client) return "you";
  if (OWN.has(owner)) return "you, over an earlier connection";
  if (owner === ANYBODY) return "everybody here";
  const [, begunBy, job] = JOB.exec(owner) ?? [];
  if (job !== undefined) return begunBy === ANYBODY ? ARTICLES[job] : `${begunBy}'s ${job}`;
  if (PARTICIPANT.test(owner)) return "the participant's page";
  const [, caller] = REST.exec(owner) ?? [];
  if (caller !== undefined) return caller === ANYBODY ? "a REST client" : `${caller}'s REST client`;
  const [, host] = PROGRAM.exec(owner) ?? [];
  if (host !== undefined) return `a program on ${host}`;
  const [, person] = PAGE.exec(owner) ?? [];
  if (person === undefined) return owner;
  if (person === ANYBODY) return "another page";
  return person === personOf(client) ? "you, in another page" : person;
}

/**
 * Why nothing can begin that arms a rig by itself, in words; empty where it can.
 *
 * @param {string|null} rig
 * @param {string|null} owner who holds it
 * @param {string} client name of this page to the rigs
 */
export function heldAlready(rig, owner, client) {
  if (owner === null) return "";
  const name = nameOf(owner, client);
  if (name === "you") return `You hold ${rig} yourself: press Disarm, then begin.`;
  return `${asBegin(name)} holds ${rig}: wait until it is disarmed, or press STOP.`;
}

/**
 * Why this page may not change what a rig renders, in words; empty where it may.
 *
 * @param {string|null} rig
 * @param {object|null} status the rig's newest
 * @param {string} client name of this page to the rigs
 */
export function keptOut(rig, status, client) {
  const { owner = null, share_with = [] } = status ?? {};
  const mine = [client, personOf(client)];
  if (owner === null || owner === client || mine.some((name) => share_with.includes(name))) {
    return "";
  }
  const name = asBegin(nameOf(owner, client));
  return `${name} holds ${rig}: what is felt is theirs to change until they disarm it.`;
}

/** As a sentence begins; the names that people have stay as they are. */
function asBegin(name) {
  return name.replace(/^(an?|the|another) /, (article) => article[0].toUpperCase() + article.slice(1));
}

/** Whom a client acts for: what stands before the last dot of its name. */
function personOf(client) {
  const end = client.lastIndexOf(".");
  return end > 0 ? client.slice(0, end) : client;
}
