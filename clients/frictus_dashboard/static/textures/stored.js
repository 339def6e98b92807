/** Textures of the library, over REST. Etags are as in headers, with their quotes. */

import { send } from "../connection/api.js";

/** @returns {Promise<{texture: object, etag: string}>} */
export async function readTexture(name) {
  const answer = await send("GET", pathOf(name));
  return { texture: await answer.json(), etag: answer.headers.get("ETag") };
}

/** The etag of what stands there; null: nothing does. */
export async function etagOf(name) {
  try {
    return (await readTexture(name)).etag;
  } catch (error) {
    if (error.code === "no_texture") return null;
    throw error;
  }
}

/**
 * @param {string} name
 * @param {object} texture
 * @param {string|null} etag of what is replaced; null: there must be nothing yet
 * @returns {Promise<string>} the etag of what stands there now
 */
export async function saveTexture(name, texture, etag) {
  const headers = etag === null ? { "If-None-Match": "*" } : { "If-Match": etag };
  const answer = await send("PUT", pathOf(name), { json: texture, headers });
  return answer.headers.get("ETag");
}

/** @param {string} etag of what is deleted; `*`: whatever stands there */
export function deleteTexture(name, etag) {
  return send("DELETE", pathOf(name), { headers: { "If-Match": etag } });
}

function pathOf(name) {
  return `/textures/${encodeURIComponent(name)}`;
}
