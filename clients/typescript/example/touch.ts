/** Draws ridges, plays them as friction under the pointer, and shows the friction that is felt. */

import { connect, type Client, type FingerState, type Rig, type TextureStream } from "../src/index.js";

const PEAK_N = 0.06;
const SPAN_N = 0.8;
const COLUMNS = 400;
/** A texture is felt until it is as old as this: who streams goes on sending. */
const TTL_MS = 1_000;

function element<T extends HTMLElement>(id: string): T {
  return document.getElementById(id) as T;
}

const screen = element<HTMLCanvasElement>("screen");
const felt = element<HTMLCanvasElement>("felt");
const ridge = element<HTMLInputElement>("ridge");
const ridges = document.createElement("canvas");
let client: Client | null = null;
let rig: Rig | null = null;
let stream: TextureStream | null = null;
let sizeMm: [number, number] = [100, 60];
let finger: FingerState | null = null;
const low: number[] = [];
const high: number[] = [];

function say(text: string): void {
  element("state").textContent = text;
}

/** One period of a ridge: smooth, so that it has no click at its edges. */
function profile(): Float32Array {
  return Float32Array.from({ length: 128 }, (_, index) => {
    const phase = (2 * Math.PI * index) / 128;
    return PEAK_N * 0.9 * Math.cos(phase);
  });
}

function sendTexture(): void {
  if (stream?.ended === null) stream.send(profile(), { periodMm: Number(ridge.value), ttlMs: TTL_MS });
}

async function play(): Promise<void> {
  client?.close();
  say("Connecting …");
  const token = element<HTMLInputElement>("token").value;
  const opened = await connect(element<HTMLInputElement>("service").value, token ? { token } : {});
  client = opened;
  rig = opened.rig(element<HTMLInputElement>("rig").value);
  opened.on("fingers", (batch) => (finger = batch.states.at(-1) ?? finger));
  opened.on("samples", (frame) => {
    low.push(...frame.low[0]!);
    high.push(...frame.high[0]!);
    low.splice(0, low.length - COLUMNS);
    high.splice(0, high.length - COLUMNS);
  });
  void opened.closed.then((reason) => opened === client && say(`Closed: ${reason}.`));
  rig.watch({ streams: ["force"], samplesPerColumn: 100, fingers: true });
  sizeMm = (await rig.status()).screen_mm;
  paintRidges();
  const lease = await rig.arm();
  stream = await rig.openStream(PEAK_N);
  sendTexture();
  const sending = setInterval(sendTexture, TTL_MS / 2);
  void lease.ended.then((reason) => {
    clearInterval(sending);
    if (reason) say(`Stopped: ${reason}.`);
  });
  say("Playing: move the pointer over the ridges.");
}

/** Paint one row of ridges, which is stretched over the screen: only when they have changed. */
function paintRidges(): void {
  ridges.width = screen.width;
  ridges.height = 1;
  const row = ridges.getContext("2d")!;
  const periodPixels = (Number(ridge.value) * screen.width) / sizeMm[0];
  for (let x = 0; x < screen.width; x++) {
    const grey = Math.round(170 + 60 * Math.cos((2 * Math.PI * x) / periodPixels));
    row.fillStyle = `rgb(${grey} ${grey} ${grey})`;
    row.fillRect(x, 0, 1, 1);
  }
}

function draw(): void {
  const picture = screen.getContext("2d")!;
  const pixelsPerMm = screen.width / sizeMm[0];
  picture.drawImage(ridges, 0, 0, screen.width, screen.height);
  if (finger?.inContact) {
    picture.fillStyle = "#b00";
    picture.beginPath();
    picture.arc(finger.xMm * pixelsPerMm, finger.yMm * pixelsPerMm, 8, 0, 2 * Math.PI);
    picture.fill();
  }
  const plot = felt.getContext("2d")!;
  plot.clearRect(0, 0, felt.width, felt.height);
  plot.fillStyle = "#05a";
  const y = (force: number) => felt.height * (0.5 - force / (2 * SPAN_N));
  low.forEach((least, index) => {
    const top = y(high[index]!);
    plot.fillRect((index * felt.width) / COLUMNS, top, 2, Math.max(1, y(least) - top));
  });
  requestAnimationFrame(draw);
}

element<HTMLFormElement>("form").addEventListener("submit", (event) => {
  event.preventDefault();
  play().catch((error: Error) => say(`It does not play: ${error.message}.`));
});
ridge.addEventListener("input", () => {
  paintRidges();
  sendTexture();
});
screen.addEventListener("pointermove", (event) => {
  const box = screen.getBoundingClientRect();
  const mmPerPixel = sizeMm[0] / box.width;
  rig?.point((event.clientX - box.left) * mmPerPixel, (event.clientY - box.top) * mmPerPixel);
});
screen.addEventListener("pointerleave", () => rig?.point(0, 0, { inContact: false }));
window.addEventListener("pagehide", () => client?.close());
paintRidges();
draw();
