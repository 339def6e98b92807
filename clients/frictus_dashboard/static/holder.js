/** Who holds a rig, and whom that keeps from changing what is felt. */

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
  return `${owner} holds ${rig}: what is felt is theirs to change until they disarm it.`;
}

/** Who holds a rig, and whom they let change what is felt. */
export function holder({ owner, share_with }, client) {
  if (owner === null) return "Nobody holds it";
  const mine = owner === client ? " (this page)" : "";
  const shared = share_with.length === 0 ? "" : `, shared with ${share_with.join(", ")}`;
  return `Held by ${owner}${mine}${shared}`;
}

/** Whom a client acts for: what stands before the last dot of its name. */
function personOf(client) {
  const end = client.lastIndexOf(".");
  return end > 0 ? client.slice(0, end) : client;
}
