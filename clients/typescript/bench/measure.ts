/** Losses, ages and processor time of a client of two raw streams and the finger: a line of JSON. */

import { connected } from "../test/service.js";

const SECONDS = Number(process.env["FRICTUS_SECONDS"] ?? 30);

await connected(async (client) => {
  client.rig("rig1").watch({ streams: ["force", "accel"], raw: true, fingers: true });
  const ages: Record<string, number[]> = { samples: [], fingers: [] };
  const count = { samples: 0, lostSamples: 0, states: 0, lostStates: 0 };
  // Age of the newest sample or state on arrival, by UTC: rig, service and client share a clock.
  const ageMs = (utcNs: bigint, offsetS: number) =>
    performance.timeOrigin + performance.now() - (Number(utcNs / 1000n) / 1e3 + offsetS * 1e3);
  await Promise.all([client.next("samples"), client.next("fingers")]);
  const began = process.cpuUsage();
  client.on("samples", (frame) => {
    count.samples += frame.columns;
    count.lostSamples += frame.lostSamples;
    ages["samples"]!.push(ageMs(frame.utcNs, (frame.columns - 1) / frame.sampleRateHz));
  });
  client.on("fingers", (batch) => {
    count.states += batch.states.length;
    count.lostStates += batch.lostStates;
    const span = batch.states.at(-1)!.sample - batch.states[0]!.sample;
    ages["fingers"]!.push(ageMs(batch.utcNs, span / batch.sampleRateHz));
  });
  await new Promise((resolve) => setTimeout(resolve, SECONDS * 1_000));
  const used = process.cpuUsage(began);
  const quantile = (values: number[], q: number) =>
    Number(values.sort((a, b) => a - b)[Math.floor(q * (values.length - 1))]!.toFixed(2));
  console.log(
    JSON.stringify({
      seconds: SECONDS,
      ...count,
      age_samples_ms: [0.5, 0.99, 1].map((q) => quantile(ages["samples"]!, q)),
      age_finger_ms: [0.5, 0.99, 1].map((q) => quantile(ages["fingers"]!, q)),
      cpu_percent: Number(((used.user + used.system) / 1e4 / SECONDS).toFixed(1)),
    }),
  );
});
