/** frictus for browsers and Node: rigs over the WebSocket /v1/live. */

export { ClosedError, Connection, OutcomeUnknownError, RefusedError } from "./connection.js";
export type { ConnectOptions, Events } from "./connection.js";
export { decode, encodeUpdate, FrameError, STREAMS } from "./frames.js";
export type { FingerBatch, FingerState, SampleFrame, StreamName, UpdateOptions } from "./frames.js";
export type * from "./messages.js";
export { Client, connect, Lease, Rig, TextureStream } from "./rig.js";
export type { ArmOptions, WatchOptions } from "./rig.js";
