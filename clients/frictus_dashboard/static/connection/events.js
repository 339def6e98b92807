/** Server-sent events, by fetch: an EventSource cannot send a token. */

import { send } from "./api.js";

/**
 * Follow a job until its stream ends; what was missed by a break comes first.
 *
 * @param {string} path below /v1, such as `/calibrations/ID/events`
 * @param {(event: {id: number, name: string, data: object}) => void} take
 * @param {{after?: number, signal?: AbortSignal}} options `after`: id of the last event known
 * @throws {Refusal} if the service refuses
 * @throws {import("./api.js").Silence} if it does not answer
 * @throws {TypeError|DOMException} if the stream breaks, or is aborted by the signal
 */
export async function follow(path, take, { after = 0, signal } = {}) {
  const headers = { Accept: "text/event-stream", "Last-Event-ID": String(after) };
  const quiet = new AbortController(); // no deadline: a job may run for an hour
  const answer = await send("GET", path, { headers, signal: signal ?? quiet.signal });
  const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
  let rest = "";
  for (;;) {
    const { done, value } = await reader.read();
    if (done) return;
    const whole = (rest + value).replaceAll("\r\n", "\n").split("\n\n");
    rest = whole.pop();
    for (const each of whole) {
      const event = parsed(each);
      if (event !== null) take(event);
    }
  }
}

/** The event of a block of lines; null for a comment, which keeps the connection alive. */
export function parsed(block) {
  const found = { id: 0, name: "message", data: "" };
  for (const line of block.split("\n")) {
    const [, field, value] = /^(\w+): ?(.*)$/.exec(line) ?? [];
    if (field === "id") found.id = Number(value);
    if (field === "event") found.name = value;
    if (field === "data") found.data += value;
  }
  return found.data === "" ? null : { ...found, data: JSON.parse(found.data) };
}
