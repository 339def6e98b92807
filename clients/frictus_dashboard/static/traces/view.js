/** Force, acceleration and voltage over time, on one axis: as they come, or as they were. */

import { TimeAxis } from "./time_axis.js";
import { COLUMNS, Trace } from "./trace.js";
import { TraceControls } from "./trace_controls.js";
import { picture, table } from "./trace_files.js";

/** Streams shown, with the names and the unit of their channels. */
const SHOWN = {
  force: { title: "Force on the finger", unit: "N", channels: ["x", "y", "z"], digits: 3 },
  accel: { title: "Acceleration", unit: "m/s²", channels: ["x", "y", "z"], digits: 2 },
  voltage: { title: "Screen voltage", unit: "V", channels: ["monitor"], digits: 1 },
};
export const STREAMS = Object.keys(SHOWN);
/** Around what somebody wants to look at, s. */
const AROUND_S = [-3, 1];

export class Traces {
  /**
   * @param {Element} root
   * @param {import("../live/event_log.js").EventLog} events that are marked
   * @param {(ns: number) => number} clock s since the device's first sample; NaN where not known
   */
  constructor(root, events, clock) {
    this.axis = new TimeAxis();
    this.events = events;
    this.clock = clock;
    this.controls = new TraceControls(root, this.axis, {
      change: (how) => this.change(how),
      table: () => table(this.traces, this.axis),
      picture: () => picture(this.traces, this.controls.title),
    });
    this.traces = STREAMS.map((stream) => new Trace(root, stream, SHOWN[stream], this));
  }

  /** Forget everything: another rig is shown. */
  open(rig) {
    for (const trace of this.traces) trace.clear();
    this.axis.restart();
    this.controls.rig = rig;
    this.change(() => {});
  }

  push(frame) {
    this.traces[STREAMS.indexOf(frame.stream)]?.push(frame);
  }

  /** Stand, move or zoom: `how` is done to the axis, and shown at once. */
  change(how) {
    how(this.axis);
    this.controls.show();
    for (const trace of this.traces) trace.draw();
    this.tell();
  }

  /** Stand where something happened; nothing changes where nothing was measured yet. */
  lookAt(ns) {
    const atS = this.clock(ns);
    if (!Number.isFinite(atS)) return;
    this.change((axis) => axis.look(AROUND_S.map((s) => atS - axis.originS + s)));
  }

  /** Draw what is new, no more often than it can be seen to move. */
  draw(nowMs) {
    this.axis.advance(Math.max(...this.traces.map(({ history }) => history.endS)));
    if (!this.axis.live) return;
    const everyMs = (1e3 * this.axis.windowS) / COLUMNS;
    for (const trace of this.traces) {
      if (!trace.fresh || nowMs - trace.drawnMs < everyMs) continue;
      trace.drawnMs = nowMs;
      trace.draw();
    }
  }

  /** Bring the words up to date. */
  tell() {
    for (const trace of this.traces) trace.tell();
  }

  /** Draw anew, in the colours of now. */
  redraw() {
    for (const { chart } of this.traces) chart.redraw();
  }
}
