/** The connection: hello, requests and their answers, what is told, and silence noticed. */

import { decode, type FingerBatch, type SampleFrame } from "./frames.js";
import type { Asked, Told, Welcome } from "./messages.js";

const PING_MS = 500;
const SILENCE_MS = 3_000;
/** Pings without an answer before a service is silent: a machine that slept has heard nothing either. */
const QUIET_PINGS = 3;
const WELCOME_MS = 5_000;
const ANSWER_MS = 10_000;
const CLOCK_READINGS = 16;
const MAX_BYTES = 65_536;
const PROTOCOL_MINOR = 1;

/** A request was refused; `code` is a stable word for programs. */
export class RefusedError extends Error {
  constructor(
    readonly code: string,
    message: string,
  ) {
    super(message);
  }
}

/** A request was sent and not answered: it may have been done, or may still be. Read the state before it is sent again. */
export class OutcomeUnknownError extends Error {}

/** The connection is gone, and with it what was armed over it. */
export class ClosedError extends Error {}

/** What can be listened to: messages by their `op`, frames, and the end. */
export type Events = { [T in Told as T["op"]]: T } & {
  samples: SampleFrame;
  fingers: FingerBatch;
  closed: string;
};

/** How to connect. */
export interface ConnectOptions {
  /** Token of the service; none where it has no tokens. */
  token?: string;
  /** In place of the global `WebSocket`: Node before 22 has it with `--experimental-websocket`. */
  WebSocket?: typeof WebSocket;
  /** For how long a request waits for its answer, ms; 10000. */
  timeoutMs?: number;
}

type Request = Extract<Asked, { id?: number | null }>;
type Answer<Op extends string> = Extract<Told, { op: Op }>;
interface Waiting {
  resolve: (answer: Told) => void;
  reject: (error: Error) => void;
}

/** A connection that stands. Made by `connect`; closing it disarms what it holds. */
export class Connection {
  /** Why it ended; never rejects. */
  readonly closed: Promise<string>;
  #socket: WebSocket;
  #listeners = new Map<string, Set<(event: never) => void>>();
  #waiting = new Map<number, Waiting>();
  #readingsUs: number[] = [];
  #heardMs = performance.now();
  #quiet = 0;
  #timer: ReturnType<typeof setInterval>;
  #ids = 0;
  #end!: (reason: string) => void;
  #ended: string | null = null;
  /** The newest refusal: the reason of a close is its code alone. */
  #refused: Answer<"refused"> | null = null;

  /** @internal */
  constructor(
    socket: WebSocket,
    /** What the service said of itself and of us. */
    readonly welcome: Welcome,
    readonly timeoutMs: number,
  ) {
    this.#socket = socket;
    this.closed = new Promise((resolve) => (this.#end = resolve));
    this.#readClock(welcome.utc_us);
    // What comes together with the welcome waits until who awaits `connect` can listen.
    const early: (string | ArrayBuffer)[] = [];
    socket.onmessage = (event) => early.push(event.data);
    const hearEarly = (): void => {
      socket.onmessage = (event) => this.#hear(event.data);
      early.splice(0).forEach((data) => this.#ended ?? this.#hear(data));
    };
    setTimeout(() => this.#ended ?? hearEarly(), 0);
    socket.onclose = (event) => {
      hearEarly(); // or what came with the end would be lost, and with it why it ended
      const { code, message } = this.#refused ?? {};
      const told = code === event.reason && message ? `${code}: ${message}` : event.reason;
      this.#lose(told || "the connection is lost");
    };
    this.#timer = setInterval(() => this.#ping(), PING_MS);
  }

  /** Why it has ended; null while it stands. */
  get ended(): string | null {
    return this.#ended;
  }

  /** Bytes that the network has not taken yet. */
  get bufferedBytes(): number {
    return this.#socket.bufferedAmount;
  }

  /** The service's clock now, µs since 1970; behind it by the fastest trip, never ahead. */
  get utcUs(): number {
    return ownUs() + Math.max(...this.#readingsUs);
  }

  /** Listen; the function that is returned ends it. */
  on<Name extends keyof Events>(name: Name, listener: (event: Events[Name]) => void): () => void {
    const listeners = this.#listeners.get(name) ?? new Set();
    this.#listeners.set(name, listeners.add(listener as (event: never) => void));
    return () => void listeners.delete(listener as (event: never) => void);
  }

  /**
   * Send a message or, as bytes, a texture update.
   * @throws ClosedError if the connection has ended, RangeError if it is too large or not finite
   */
  send(message: Asked | ArrayBuffer): void {
    if (this.#ended !== null) throw new ClosedError(`the connection has ended (${this.#ended}): connect again`);
    this.#socket.send(message instanceof ArrayBuffer ? message : textOf(message));
  }

  /**
   * Send a request and wait for its answer.
   * @throws RefusedError if it is refused, OutcomeUnknownError without an answer in time, else as `send`
   */
  async ask<Op extends Told["op"]>(request: Request, _answer: Op): Promise<Answer<Op>> {
    const id = this.#ids++;
    let due: ReturnType<typeof setTimeout> | undefined;
    const answered = new Promise<Told>((resolve, reject) => {
      this.#waiting.set(id, { resolve, reject });
      due = setTimeout(() => reject(unanswered(request.op, this.timeoutMs)), this.timeoutMs);
    });
    try {
      this.send({ ...request, id });
      return (await answered) as Answer<Op>;
    } finally {
      clearTimeout(due);
      this.#waiting.delete(id);
    }
  }

  /** Close; what is armed is disarmed. */
  close(): void {
    this.#lose("closed by this client");
  }

  #hear(data: string | ArrayBuffer): void {
    this.#heardMs = performance.now();
    this.#quiet = 0;
    let heard: ReturnType<typeof read>;
    try {
      heard = read(data);
    } catch (error) {
      this.#lose(`the service sent what cannot be read: ${(error as Error).message}`);
      return;
    }
    if (heard === null) return;
    if ("states" in heard) return this.#emit("fingers", heard);
    if ("samplesPerColumn" in heard) return this.#emit("samples", heard);
    const told = heard;
    if (told.op === "pong") this.#readClock(told.utc_us);
    const waiting = "id" in told && told.id !== null ? this.#waiting.get(told.id) : undefined;
    if (told.op === "refused") {
      this.#refused = told;
      waiting?.reject(new RefusedError(told.code, told.message));
    } else if (told.op !== "pong") {
      waiting?.resolve(told);
    }
    this.#emit(told.op, told as never);
  }

  #emit<Name extends keyof Events>(name: Name, event: Events[Name]): void {
    for (const listener of [...(this.#listeners.get(name) ?? [])]) {
      try {
        listener(event as never);
      } catch (error) {
        queueMicrotask(() => { throw error; }); // told as ever, but the others are to hear too
      }
    }
  }

  #readClock(utcUs: number): void {
    this.#readingsUs.push(utcUs - ownUs());
    if (this.#readingsUs.length > CLOCK_READINGS) this.#readingsUs.shift();
  }

  #ping(): void {
    if (performance.now() - this.#heardMs > SILENCE_MS && this.#quiet >= QUIET_PINGS) {
      this.#lose("the service has fallen silent");
    } else {
      this.#quiet++;
      this.#socket.send(JSON.stringify({ op: "ping", id: this.#ids++ }));
    }
  }

  #lose(reason: string): void {
    if (this.#ended !== null) return;
    this.#ended = reason;
    clearInterval(this.#timer);
    this.#socket.onmessage = this.#socket.onclose = null;
    this.#socket.close();
    for (const { reject } of this.#waiting.values()) reject(new ClosedError(reason));
    this.#emit("closed", reason);
    this.#end(reason);
  }
}

/**
 * Open a connection and wait until the service has welcomed it.
 * @param url such as `ws://127.0.0.1:8420`
 * @throws RefusedError if the token is not accepted, ClosedError if nobody answers
 */
export async function open(url: string, options: ConnectOptions = {}): Promise<Connection> {
  const Socket = options.WebSocket ?? globalThis.WebSocket;
  if (Socket === undefined) {
    throw new ClosedError("no WebSocket here: give one, or start node --experimental-websocket");
  }
  if (!/^(wss?|https?):/.test(url)) {
    throw new ClosedError(`${url} is no address: give one such as ws://HOST:8420, or wss://HOST with TLS`);
  }
  const socket = new Socket(new URL("/v1/live", url));
  socket.binaryType = "arraybuffer";
  try {
    return await welcomed(socket, options.token ?? null, options.timeoutMs ?? ANSWER_MS);
  } catch (error) {
    socket.onopen = socket.onmessage = socket.onclose = null;
    socket.close();
    throw error;
  }
}

/** What else may be wrong than an absent service, which browsers do not tell apart. */
function besides(url: string): string {
  const { origin } = globalThis.location ?? {};
  const tls = url.startsWith("wss:") ? ", speaks no TLS, or has a certificate that is not trusted here" : "";
  return origin === undefined ? tls : `${tls}, or its [api] origins does not have "${origin}"`;
}

async function welcomed(
  socket: WebSocket,
  token: string | null,
  timeoutMs: number,
): Promise<Connection> {
  let due: ReturnType<typeof setTimeout> | undefined;
  const connection = new Promise<Connection>((resolve, reject) => {
    const fail = (reason: string) => reject(new ClosedError(reason));
    due = setTimeout(() => fail(`no welcome from ${socket.url}`), WELCOME_MS);
    socket.onopen = () => socket.send(JSON.stringify({ op: "hello", version: 1, token }));
    socket.onerror = () => fail(`no connection to ${socket.url}: the service is not there${besides(socket.url)}`);
    socket.onclose = (event) => fail(event.reason || `${socket.url} has closed the connection`);
    socket.onmessage = (event) => {
      let told: Told;
      try {
        told = JSON.parse(event.data as string) as Told;
      } catch {
        return fail(`${socket.url} sent no JSON: is it frictus?`);
      }
      if (told.op === "refused") return reject(new RefusedError(told.code, told.message));
      if (told.op !== "welcome") return fail(`${socket.url} does not welcome: it sent ${told.op}`);
      socket.onerror = null; // a close follows each error
      // At once, not after the promise: `rigs` may have come in the same bytes.
      const [major, minor] = (told.protocol ?? "1.0").split(".").map(Number);
      if (major === 1 && minor! >= PROTOCOL_MINOR) resolve(new Connection(socket, told, timeoutMs));
      else fail(`the service speaks ${told.protocol ?? "1.0"}, this client 1.1: update it`);
    };
  });
  try {
    return await connection;
  } finally {
    clearTimeout(due);
  }
}

/** The text of a message that the service does not end the connection over, and with it the lease. */
function textOf(message: Asked): string {
  const text = JSON.stringify(message, (name, value: unknown) => {
    if (typeof value === "number" && !Number.isFinite(value)) {
      throw new RangeError(`${message.op}: ${value} at ${name}: finite numbers are accepted`);
    }
    return value;
  });
  const { length } = new TextEncoder().encode(text);
  if (length <= MAX_BYTES) return text;
  throw new RangeError(
    `${message.op} of ${length} bytes: at most ${MAX_BYTES}; a larger scene goes by REST, PUT /v1/rigs/RIG/scene`,
  );
}

function read(data: string | ArrayBuffer): Told | ReturnType<typeof decode> {
  return typeof data === "string" ? (JSON.parse(data) as Told) : decode(data);
}

function unanswered(op: string, timeoutMs: number): OutcomeUnknownError {
  return new OutcomeUnknownError(
    `${op} was sent and not answered within ${timeoutMs} ms: read what it was to change before it is sent again`,
  );
}

function ownUs(): number {
  return (performance.timeOrigin + performance.now()) * 1_000;
}
