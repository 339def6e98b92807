/** Requests to the REST API. */

import { token } from "./token.js";

const TIMEOUT_MS = 5_000;
let pageKey = null;

/** Have requests act as this page, by the key of its connection; null: as any script. */
export function actAs(key) {
  pageKey = key;
}

/** What the service answered with an error; `code` is its stable word. */
export class Refusal extends Error {
  constructor(status, code, message) {
    super(message);
    this.status = status;
    this.code = code;
  }
}

/** The service has not answered; `changes`: what it was asked may be done all the same. */
export class Silence extends Error {
  constructor(message, changes) {
    super(message);
    this.changes = changes;
  }
}

/** Whether what was asked for may have been done all the same. @param {Error} error */
export function outcomeUnknown(error) {
  const mayBeDone = ["outcome_unknown", "not_noted"].includes(error.code);
  return mayBeDone || (error instanceof Silence && error.changes);
}

/**
 * Send a request and return its answer, whose headers and body are still to be read.
 *
 * @param {string} method
 * @param {string} path below /v1, such as `/rigs`
 * @param {{json?: object, body?: BodyInit, headers?: Object<string, string>, timeoutMs?: number,
 *   signal?: AbortSignal}} options `json` becomes the body, as JSON; without `signal` the answer
 *   has to come within `timeoutMs`
 * @returns {Promise<Response>}
 * @throws {Refusal} if the service refuses
 * @throws {Silence} if it does not answer
 * @throws {DOMException} if `signal` aborts it
 */
export async function send(method, path, options = {}) {
  const { json, body = json && JSON.stringify(json), timeoutMs = TIMEOUT_MS } = options;
  const given = token();
  const headers = { ...options.headers };
  if (given !== null) headers.Authorization = `Bearer ${given}`;
  if (pageKey !== null) headers["Frictus-Page"] = pageKey;
  if (json) headers["Content-Type"] = "application/json";
  const changes = method !== "GET";
  const asked = fetch(`/v1${path}`, {
    method,
    headers,
    body,
    signal: options.signal ?? AbortSignal.timeout(timeoutMs),
    keepalive: method === "POST" && !body, // a stop goes out even if the page is closed on it
  });
  const answer = await inWords(asked, changes);
  if (answer.ok) return answer;
  const { status } = answer;
  const said = await answer.json().catch(() => null);
  if (said === null) {
    const words = `a proxy answers in place of the service: ${status} ${answer.statusText}`.trim();
    throw new Silence(words, changes && status >= 500);
  }
  const faults = (said.errors ?? []).map(({ where, what }) => `${where.join(".")}: ${what}`);
  throw new Refusal(status, said.code, [said.detail ?? said.title, ...faults].join("; "));
}

/** Send a request and return the JSON of its answer; see `send`. */
export async function request(method, path, options = {}) {
  const answer = await send(method, path, options);
  return answer.status === 204 ? null : inWords(answer.json(), method !== "GET");
}

/** What the network gives; where it fails, in words for people, which browsers have not. */
async function inWords(asked, changes) {
  try {
    return await asked;
  } catch (error) {
    if (error.name === "TimeoutError") {
      throw new Silence("the service has not answered in time", changes);
    }
    if (error instanceof TypeError) throw new Silence("the service cannot be reached", changes);
    throw error;
  }
}
