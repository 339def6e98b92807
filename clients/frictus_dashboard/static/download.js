/** Save what the service serves as a file: a link could not present the token. */

import { send } from "./api.js";
import { element } from "./element.js";

/** Browsers read what is saved after the click. */
const KEPT_MS = 60_000;

/**
 * @param {string} path below /v1
 * @param {string} name of the file
 * @throws {import("./api.js").Refusal} if the service refuses
 * @throws {import("./api.js").Silence} if it does not answer
 */
export async function save(path, name) {
  const answer = await send("GET", path);
  const url = URL.createObjectURL(await answer.blob());
  element("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), KEPT_MS);
}
