import assert from "node:assert/strict";
import { test } from "node:test";

import { ClosedError, connect, type Lease, RefusedError, type SampleFrame, type Scene } from "../src/index.js";
import { connected, sine, skip, stop, URL } from "./service.js";

const SCENE: Scene = {
  name: "ridges",
  regions: [{ texture: { kind: "profile", period_mm: 2, friction_n: [0, 0.02, 0, -0.02] } }],
};

test("samples follow one another, and states of the finger", { skip }, () =>
  connected(async (client) => {
    const rig = client.rig("rig1");
    rig.watch({ streams: ["force", "accel"], raw: true, fingers: true });
    const next = new Map<string, number>();
    let frames = 0;
    const follow = (frame: SampleFrame) => {
      const expected = next.get(frame.stream);
      if (expected !== undefined) assert.equal(frame.firstSample, expected + frame.lostSamples);
      next.set(frame.stream, frame.firstSample + frame.columns * frame.samplesPerColumn);
      frames++;
    };
    client.on("samples", follow);
    await client.next("samples", () => frames > 40);
    assert.deepEqual([...next.keys()].sort(), ["accel", "force"]);
    const batch = await client.next("fingers");
    const samples = batch.states.map((state) => state.sample);
    assert.deepEqual(samples, [...samples].sort((a, b) => a - b));
    assert.ok(Math.abs(Number(batch.utcNs) / 1e3 - client.connection.utcUs) < 60e6);
    assert.equal((await rig.status()).simulated, true);
  }));

test("a rig is taken, changed, streamed to and given back", { skip }, () =>
  connected(async (client) => {
    const rig = client.rig("rig1");
    rig.watch();
    const lease = await rig.arm({ leaseMs: 10_000 });
    const set = await rig.setScene(SCENE);
    assert.equal(set.applied.gain, 1);
    await assert.rejects(rig.setScene({}, "another"), { code: "conflict" });
    const stream = await rig.openStream(0.05);
    assert.ok(stream.applied!.gain > 0);
    assert.throws(() => stream.send(sine(0.06), { periodMm: 2 }), /peak of 0.05 N/);
    await rig.status((status) => status.owner === client.name && status.stream_open);
    for (let update = 0; update < 20; update++) {
      assert.ok(stream.send(sine(0.04), { periodMm: 2, ttlMs: 2_000 }));
      await client.next("stream", (told) => told.newest === update);
    }
    const closed = await stream.close();
    assert.deepEqual([closed.sent, closed.superseded, closed.expired], [20, 0, 0]);
    await lease.disarm();
    assert.equal(await lease.ended, "");
    await rig.status((status) => status.state === "disarmed");
    assert.throws(() => stream.send(sine(0.04), {}), RangeError);
  }));

test("what is sent to a stream that has ended is no success", { skip }, () =>
  connected(async (client) => {
    const rig = client.rig("rig1");
    for (const [end, why] of [
      [(lease: Lease) => lease.disarm(), /given back/],
      [() => stop(client), /has ended: the rig is /],
    ] as const) {
      const lease = await rig.arm({ leaseMs: 10_000 });
      const stream = await rig.openStream(0.05);
      assert.equal(stream.ended, null);
      const disarmed = client.next("disarmed");
      await end(lease);
      await disarmed;
      assert.throws(() => stream.send(sine(0.04), { periodMm: 2 }), (error) => {
        assert.ok(error instanceof RefusedError);
        assert.match(error.message, why);
        return error.code === "no_stream";
      });
    }
  }));

test("closing gives the rig back", { skip }, () =>
  connected(async (other) => {
    const rig = other.rig("rig1");
    rig.watch();
    await connected(async (client) => {
      await client.rig("rig1").arm();
      await rig.status((status) => status.owner === client.name);
      await assert.rejects(rig.arm(), { code: "not_owner" });
      client.close();
      assert.equal(await client.closed, "closed by this client");
      await assert.rejects(client.rig("rig1").arm(), ClosedError);
    });
    await rig.status((status) => status.state === "disarmed" && status.owner === null);
  }));

test("who is not known is refused, and where nobody listens is said", { skip }, async () => {
  if (process.env["FRICTUS_TOKEN"] !== undefined) {
    await assert.rejects(connect(URL!, { token: "not-a-token" }), (error) => {
      assert.ok(error instanceof RefusedError);
      return error.code === "unauthenticated";
    });
  }
  await assert.rejects(connect("ws://127.0.0.1:1"), ClosedError);
});
