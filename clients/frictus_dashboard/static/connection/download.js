/** Save as a file what the service serves, since a link could not present the token, or the page has. */

import { send } from "./api.js";
import { element } from "../elements/element.js";

/** Browsers read what is saved after the click. */
const KEPT_MS = 60_000;

/**
 * @param {string} path below /v1
 * @param {string} name of the file
 * @param {{signal?: AbortSignal}} options `signal` takes the place of the deadline
 * @throws {import("./api.js").Refusal} if the service refuses
 * @throws {import("./api.js").Silence} if it does not answer
 */
export async function save(path, name, options = {}) {
  const answer = await send("GET", path, options);
  saveBlob(await answer.blob(), name);
}

/**
 * @param {Blob} blob
 * @param {string} name of the file
 */
export function saveBlob(blob, name) {
  const url = URL.createObjectURL(blob);
  element("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), KEPT_MS);
}
