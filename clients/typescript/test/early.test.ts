import assert from "node:assert/strict";
import { test } from "node:test";
import { setFlagsFromString } from "node:v8";
import { runInNewContext } from "node:vm";

import { ClosedError, connect, OutcomeUnknownError } from "../src/index.js";

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

test("a listener that throws keeps no other from hearing, the end neither", async (t) => {
  const client = await connect("ws://127.0.0.1", { WebSocket: AllAtOnce as never });
  const thrown: unknown[] = [];
  t.mock.method(globalThis, "queueMicrotask", (task: () => void) => {
    try {
      task();
    } catch (error) {
      thrown.push(error);
    }
  });
  const fault = new Error("of the page");
  for (const name of ["rigs", "closed"] as const) {
    client.on(name, () => {
      throw fault;
    });
  }
  let heard = 0;
  await client.next("rigs", () => ++heard === 2);
  const never = client.next("status");
  client.close();
  assert.equal(await client.closed, "closed by this client");
  await assert.rejects(never, ClosedError);
  await assert.rejects(client.next("status"), ClosedError);
  assert.deepEqual(thrown, [fault, fault, fault]);
});

test("a request that is not answered does not wait for ever", async () => {
  const client = await connect("ws://127.0.0.1", { WebSocket: AllAtOnce as never, timeoutMs: 20 });
  await assert.rejects(client.rig("rig1").arm(), (error: Error) => {
    assert.ok(error instanceof OutcomeUnknownError);
    assert.match(error.message, /^arm was sent and not answered within 20 ms/);
    return true;
  });
  client.close();
});

/** Refuses what it is asked, and closes, as a service does where a request is out of range. */
class Refusing extends AllAtOnce {
  override send(text: string): void {
    super.send(text);
    if (JSON.parse(text).op !== "arm") return;
    const refused = { op: "refused", what: "arm", code: "malformed", message: "lease_ms: 500 to 10000", id: null };
    queueMicrotask(() => {
      this.onmessage?.({ data: JSON.stringify(refused) });
      this.onclose?.({ reason: "malformed" });
    });
  }
}

test("why the service closed is told in its words", async () => {
  const client = await connect("ws://127.0.0.1", { WebSocket: Refusing as never });
  const told = "malformed: lease_ms: 500 to 10000";
  await assert.rejects(client.rig("rig1").arm({ leaseMs: 1 }), { message: told });
  assert.equal(await client.closed, told);
});

test("what the service would end the connection over is refused before it is sent", async () => {
  const client = await connect("ws://127.0.0.1", { WebSocket: AllAtOnce as never, timeoutMs: 20 });
  const rig = client.rig("rig1");
  const scene = (friction_n: number[]) => ({
    regions: [{ texture: { kind: "profile" as const, friction_n, period_mm: 100 } }],
  });
  await assert.rejects(rig.setScene(scene([0, NaN])), RangeError);
  await assert.rejects(rig.setScene(scene(Array<number>(32_768).fill(0))), {
    name: "RangeError",
    message: /^set_scene of \d+ bytes: at most 65536; a larger scene goes by REST/,
  });
  for (const peakN of [0, 11, NaN]) await assert.rejects(rig.openStream(peakN), RangeError);
  assert.throws(() => rig.point(NaN, 0), RangeError);
  assert.throws(() => rig.point(0, 10_001), RangeError);
  assert.throws(() => rig.point(0, 0, { normalForceN: 6 }), RangeError);
  assert.equal(client.connection.ended, null);
  client.close();
  assert.throws(() => rig.point(0, 0), /ended \(closed by this client\)/);
});

test("a machine that slept asks before it takes the service for silent", async (t) => {
  t.mock.timers.enable({ apis: ["setInterval"] });
  let nowMs = performance.now();
  t.mock.method(performance, "now", () => nowMs);
  const client = await connect("ws://127.0.0.1", { WebSocket: AllAtOnce as never });
  await client.next("rigs"); // from here on nothing comes
  nowMs += 60_000;
  t.mock.timers.tick(500);
  assert.equal(client.connection.ended, null);
  for (let ping = 0; ping < 3; ping++) t.mock.timers.tick(500);
  assert.equal(await client.closed, "the service has fallen silent");
});

test("what was waited for is not kept", async () => {
  const client = await connect("ws://127.0.0.1", { WebSocket: AllAtOnce as never });
  const kept = await client.next("rigs").then((told) => new WeakRef(told));
  await new Promise(setImmediate); // a WeakRef holds on until the end of its task
  setFlagsFromString("--expose-gc");
  runInNewContext("gc")();
  assert.equal(kept.deref(), undefined);
  client.close();
});
