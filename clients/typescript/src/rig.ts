/** What one does with a rig: watch it, take it, set a scene, stream a texture. */

import { open, ClosedError, RefusedError, type Connection, type ConnectOptions, type Events } from "./connection.js";
import { encodeUpdate, within, type StreamName, type UpdateOptions } from "./frames.js";
import type { Applied, RigStatus, Scene, StreamClosed } from "./messages.js";

/** An update is held back while so many bytes wait for the network. */
const MAX_BUFFERED_BYTES = 65_536;

/** What to be told of the rig. */
export interface WatchOptions {
  streams?: StreamName[];
  /** Most frames of a stream, and messages, per second: 1 to 60; 60. */
  rateHz?: number;
  /** Samples as they are; else the extremes of each column. */
  raw?: boolean;
  /** Samples that a column stands for; 40. */
  samplesPerColumn?: number;
  /** Every state of the finger, in batches: the event `fingers`. */
  fingers?: boolean;
}

/** How to take a rig. */
export interface ArmOptions {
  /** Clients and people who may change what is rendered meanwhile. */
  shareWith?: string[];
  /** The rig is given back when we send nothing for so long, 500 to 10000; 3000. */
  leaseMs?: number;
  /** Whether no tracker may change the model meanwhile: for trials. */
  keepModel?: boolean;
}

/** A connection to the rigs of one service. Made by `connect`. */
export class Client {
  /** @internal */
  constructor(readonly connection: Connection) {}

  /** Name under which rigs know us: the `owner` of what we have armed. */
  get name(): string {
    return this.connection.welcome.client;
  }

  /** Why the connection ended. */
  get closed(): Promise<string> {
    return this.connection.closed;
  }

  /** Listen to messages, `samples`, `fingers` and `closed`; returns what ends it. */
  on<Name extends keyof Events>(name: Name, listener: (event: Events[Name]) => void): () => void {
    return this.connection.on(name, listener);
  }

  /** Wait for the next event for which something holds. */
  next<Name extends keyof Events>(
    name: Name,
    holds: (event: Events[Name]) => boolean = () => true,
  ): Promise<Events[Name]> {
    return new Promise((resolve, reject) => {
      const { ended } = this.connection;
      if (ended !== null) return reject(new ClosedError(ended));
      const forget = () => [unheard, unclosed].forEach((end) => end());
      const unheard = this.on(name, (event) => {
        if (!holds(event)) return;
        forget();
        resolve(event);
      });
      // Not by `closed`, which would keep all that was ever waited for until the end.
      const unclosed = this.on("closed", (reason) => {
        forget();
        reject(new ClosedError(reason));
      });
    });
  }

  /** A rig by its name; nothing is asked yet. */
  rig(name: string): Rig {
    return new Rig(this, name);
  }

  /** Close; what is armed is disarmed. */
  close(): void {
    this.connection.close();
  }
}

/** Connect to a service, such as `ws://127.0.0.1:8420`. */
export async function connect(url: string, options: ConnectOptions = {}): Promise<Client> {
  return new Client(await open(url, options));
}

/** One rig. */
export class Rig {
  /** @internal */
  constructor(
    readonly client: Client,
    readonly name: string,
  ) {}

  /** Be told of this rig, in place of what was watched. */
  watch(options: WatchOptions = {}): void {
    this.client.connection.send({
      op: "watch",
      rig: this.name,
      streams: options.streams ?? [],
      rate_hz: options.rateHz ?? 60,
      raw: options.raw ?? false,
      samples_per_column: options.samplesPerColumn ?? 40,
      fingers: options.fingers ?? false,
    });
  }

  /** The next status of the rig, which is to be watched. */
  async status(holds: (status: RigStatus) => boolean = () => true): Promise<RigStatus> {
    const told = await this.client.next(
      "status",
      (event) => event.rig === this.name && holds(event.status),
    );
    return told.status;
  }

  /** Take the rig and let it drive its screen while this connection stands. */
  async arm(options: ArmOptions = {}): Promise<Lease> {
    const request = {
      op: "arm",
      rig: this.name,
      share_with: options.shareWith ?? [],
      lease_ms: options.leaseMs ?? 3_000,
      keep_model: options.keepModel ?? false,
    } as const;
    await this.client.connection.ask(request, "armed");
    return new Lease(this);
  }

  /** Replace what the screen feels like; returns the etag and what the rig made of it. */
  async setScene(scene: Scene, ifMatch?: string): Promise<{ etag: string; applied: Applied }> {
    const request = { op: "set_scene", rig: this.name, scene, if_match: ifMatch ?? null } as const;
    return this.client.connection.ask(request, "scene_set");
  }

  /** Open a texture stream; `peakN` is the largest |friction| that will be sent. */
  async openStream(peakN: number): Promise<TextureStream> {
    within("peakN", peakN, 1e-6, 10);
    const request = { op: "open_stream", rig: this.name, peak_n: peakN } as const;
    const { ticket, applied } = await this.client.connection.ask(request, "stream_opened");
    return new TextureStream(this, ticket, peakN, applied);
  }

  /** Move the virtual finger of a simulated rig, which is to be watched. */
  point(xMm: number, yMm: number, options: { inContact?: boolean; normalForceN?: number } = {}): void {
    const { inContact = true, normalForceN = 0.4 } = options;
    within("xMm", xMm, -10_000, 10_000);
    within("yMm", yMm, -10_000, 10_000);
    within("normalForceN", normalForceN, 0, 5);
    this.client.connection.send({
      op: "point",
      x_mm: xMm,
      y_mm: yMm,
      in_contact: inContact,
      normal_force_n: normalForceN,
    });
  }
}

/** The right to drive a rig's screen. */
export class Lease {
  /** Why it ended; empty where `disarm` ended it. */
  readonly ended: Promise<string>;

  /** @internal */
  constructor(readonly rig: Rig) {
    const { client, name } = rig;
    this.ended = Promise.race([
      client.next("disarmed", (told) => told.rig === name).then((told) => told.reason),
      client.closed,
    ]);
    this.ended.catch(() => {}); // `closed` has said it
  }

  /** Ramp the output to zero and give the rig back. */
  async disarm(): Promise<void> {
    const request = { op: "disarm", rig: this.rig.name } as const;
    await this.rig.client.connection.ask(request, "disarmed");
  }
}

/** A texture that is sent while it is felt. Made by `Rig.openStream`. */
export class TextureStream {
  /** Updates handed to the network. */
  sent = 0;
  /** Updates left out, for the network had not taken those before. */
  heldBack = 0;
  readonly client: Client;
  #ended: string | null = null;

  /** @internal */
  constructor(
    rig: Rig,
    readonly ticket: number,
    /** The largest |friction| that was announced, N. */
    readonly peakN: number,
    /** What the rig made of the peak. */
    readonly applied: Applied | null,
  ) {
    this.client = rig.client;
    const unheard = [
      this.client.on("stream_closed", (told) => {
        if (told.ticket === ticket) end(told.reason || "it was closed");
      }),
      this.client.on("disarmed", (told) => {
        if (told.rig === rig.name) end(told.reason || "the rig was given back");
      }),
    ];
    const end = (reason: string): void => {
      this.#ended ??= reason;
      unheard.forEach((forget) => forget());
    };
  }

  /** Why nothing plays what is sent any more; null while it is played. */
  get ended(): string | null {
    return this.#ended;
  }

  /**
   * Send one period of friction, N, 2 to 4096 samples; the rig cross-fades to it.
   * @returns whether it was sent: not while the network is behind; a newer one is worth more
   * @throws RangeError if a value is out of range, or friction above the peak
   * @throws RefusedError with `no_stream` once it has ended: somebody stopped the rig, say
   */
  send(frictionN: ArrayLike<number>, options: UpdateOptions): boolean {
    const connection = this.client.connection;
    for (let index = 0; index < frictionN.length; index++) {
      if (Math.abs(frictionN[index]!) <= this.peakN * (1 + 1e-6)) continue; // NaN is not
      throw new RangeError(`friction ${frictionN[index]}: within the declared peak of ${this.peakN} N`);
    }
    const bytes = encodeUpdate(this.ticket, this.sent, connection.utcUs, frictionN, options);
    if (this.#ended !== null) {
      throw new RefusedError("no_stream", `the stream has ended: ${this.#ended}`);
    }
    if (connection.bufferedBytes > MAX_BUFFERED_BYTES) {
      this.heldBack++;
      return false;
    }
    connection.send(bytes);
    this.sent++;
    return true;
  }

  /** End the stream; the rig fades to the scene. Returns what became of the updates. */
  close(): Promise<StreamClosed> {
    return this.client.connection.ask({ op: "close_stream" }, "stream_closed");
  }
}
