/** Where the service that tests talk to is; `npm test` alone has none, and skips them. */

import { connect, type Client } from "../src/index.js";

export const URL = process.env["FRICTUS_URL"];
export const skip = URL === undefined ? "FRICTUS_URL names no service" : false;

export async function connected(work: (client: Client) => Promise<void>): Promise<void> {
  const token = process.env["FRICTUS_TOKEN"];
  const client = await connect(URL!, token === undefined ? {} : { token });
  try {
    await work(client);
  } finally {
    client.close();
  }
}

/** Stop the rig over REST, as whoever may look may. */
export async function stop(client: Client): Promise<void> {
  const token = process.env["FRICTUS_TOKEN"];
  const address = new globalThis.URL("/v1/rigs/rig1/stop", URL!.replace(/^ws/, "http"));
  const headers = { "Frictus-Page": client.connection.welcome.key, Authorization: `Bearer ${token}` };
  const answer = await fetch(address, { method: "POST", headers: token === undefined ? {} : headers });
  if (!answer.ok) throw new Error(`the stop was answered with ${answer.status}`);
}

export function sine(amplitudeN: number, samples = 64): Float32Array {
  return Float32Array.from({ length: samples }, (_, index) =>
    amplitudeN * Math.sin((2 * Math.PI * index) / samples),
  );
}
