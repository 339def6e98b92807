/** The scene of a rig: replaced, and what the rig made of it in words. */

import { send } from "../connection/api.js";
import { percent } from "../elements/figures.js";

/** A new scene may take a while to be compiled on a busy rig. */
const TIMEOUT_MS = 15_000;

/**
 * Replace a rig's scene.
 *
 * @param {string} rig
 * @param {object} scene
 * @param {string} match what it replaces: an etag, or `*` for whatever stands there
 * @returns {Promise<{applied: object, etag: string}>} what the rig made of it
 * @throws {import("../connection/api.js").Refusal} `not_owner`, `not_feasible`, `conflict`, …
 */
export async function replaceScene(rig, scene, match) {
  const answer = await send("PUT", `/rigs/${encodeURIComponent(rig)}/scene`, {
    json: scene,
    headers: { "If-Match": match === "*" ? match : `"${match}"` },
    timeoutMs: TIMEOUT_MS,
  });
  const etag = (answer.headers.get("ETag") ?? "").replaceAll('"', "");
  return { applied: await answer.json(), etag };
}

/**
 * What a state of the rig tells of a scene that was asked for: as `replaceScene` answers, or null
 * where the rig renders another.
 *
 * @param {object} asked
 * @returns {(state: object) => {applied: object, etag: string}|null}
 */
export function sceneIn(asked) {
  const sent = JSON.parse(JSON.stringify(asked)); // without what is undefined
  return ({ scene }) => (scene !== null && holds(scene.scene, sent) ? scene : null);
}

/** Whether a document has all that was asked for; what was left open the rig fills in. */
function holds(shown, asked) {
  if (asked === null || typeof asked !== "object") return shown === asked;
  if (shown === null || typeof shown !== "object") return false;
  if (Array.isArray(asked) && asked.length !== shown.length) return false;
  return Object.entries(asked).every(([key, value]) => holds(shown[key], value));
}

/** What a rig made of a scene. @param {object} applied */
export function words(applied) {
  const said = [`${percent(applied.gain)} of the friction asked for`];
  if (applied.scaled) said.push("scaled to what the drive can give");
  said.push(`bias ${applied.bias_n.toFixed(3)} N, ${percent(applied.bias)} of the drive`);
  return [...said, ...applied.notes].join("; ");
}

/** What a rig renders. @param {string} rig @param {{status: object, scene: object}} state */
export function rendered(rig, { status, scene }) {
  const { source, applied } = scene;
  const idle = status.state === "armed" ? "" : ` It is ${status.state}: arm it to feel this.`;
  if (source === "excitation") return `${rig} plays an excitation, as in a calibration.`;
  const what = source === "stream" ? "what a client streams" : contents(scene.scene);
  return `${rig} renders ${what}: ${words(applied)}.${idle}`;
}

function contents({ name, regions }) {
  const names = regions.map((region, i) => region.name || `Region ${i + 1}`);
  return `the scene ${name || "without a name"} (${names.join(", ") || "a smooth screen"})`;
}
