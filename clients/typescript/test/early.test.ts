import assert from "node:assert/strict";
import { test } from "node:test";

import { connect } from "../src/index.js";

const WELCOME = { op: "welcome", protocol: "1.1", client: "x", utc_us: 1 };
const RIGS = { op: "rigs", rigs: ["rig1"], link: true };

/** Hands over all that came in the same bytes before anything else has a turn. */
class AllAtOnce {
  bufferedAmount = 0;
  onopen?: () => void;
  onmessage?: (event: { data: string }) => void;
  onclose?: (event: { reason: string }) => void;

  constructor() {
    queueMicrotask(() => this.onopen?.());
  }

  send(text: string): void {
    if (JSON.parse(text).op !== "hello") return;
    for (const told of [WELCOME, RIGS, RIGS]) this.onmessage?.({ data: JSON.stringify(told) });
  }

  close(): void {}
}

test("what comes together with the welcome is heard by who listens after it", async () => {
  const client = await connect("ws://127.0.0.1", { WebSocket: AllAtOnce as never });
  let heard = 0;
  client.on("rigs", ({ rigs }) => {
    assert.deepEqual(rigs, ["rig1"]);
    if (++heard === 2) client.close();
  });
  assert.equal(await client.closed, "closed by this client");
  assert.equal(heard, 2);
});
