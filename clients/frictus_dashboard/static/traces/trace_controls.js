/** What one does with the traces: choose a window, pause, go back, save. */

import { saveBlob } from "../connection/download.js";
import { at, element, say } from "../elements/element.js";
import { button } from "../elements/fields.js";
import { KEPT_S, WINDOWS_S } from "./time_axis.js";

// A number and its unit stay on one line.
const named = (s) => (s < 60 ? `${s}\u00a0s` : `${s / 60}\u00a0min`);

export class TraceControls {
  /**
   * @param {Element} root before whose charts they stand
   * @param {import("./time_axis.js").TimeAxis} axis
   * @param {{change: (how: (axis: object) => void) => void, table: () => Blob,
   *   picture: () => Promise<Blob>}} does
   */
  constructor(root, axis, { change, table, picture }) {
    this.axis = axis;
    this.rig = null;
    this.pause = button("Pause", () => {
      change((time) => (time.live ? time.pause() : time.resume()));
    });
    this.windows = WINDOWS_S.map((s) => button(named(s), () => change((time) => time.show(s))));
    this.back = element("input", { type: "range", max: "0", value: "0", step: "any" });
    this.back.addEventListener("input", () => {
      const endS = Number(this.back.value);
      change((time) => time.look([endS - time.windowS, endS]));
    });
    const group = { class: "segments", role: "group", "aria-label": "How much is shown" };
    root.append(
      element(
        "div",
        { class: "fields" },
        this.pause,
        element("div", group, ...this.windows),
        element("label", {}, "Go back", this.back),
        button("CSV", () => this.#save(table(), "csv")),
        button("PNG", async () => this.#save(await picture(), "png")),
      ),
    );
  }

  /** What is shown, in words. */
  get title() {
    const { axis } = this;
    if (axis.live) return `What is measured, the last ${named(axis.windowS)}`;
    const [from, to] = axis.range.map((s) => `${Math.max(0, -s).toFixed(2)}\u00a0s`);
    return `What was measured, ${from} to ${to} before the pause`;
  }

  /** Bring buttons and words up to date. */
  show() {
    const { axis } = this;
    say(at("traces-title"), this.title);
    say(this.pause, axis.live ? "Pause" : "Go on");
    this.pause.setAttribute("aria-pressed", String(!axis.live));
    WINDOWS_S.forEach((s, i) => {
      this.windows[i].setAttribute("aria-pressed", String(s === axis.windowS));
    });
    this.back.min = String(axis.windowS - KEPT_S);
    this.back.value = String(axis.range[1]);
    this.back.setAttribute("aria-valuetext", this.title);
  }

  #save(blob, suffix) {
    const now = new Date().toISOString().slice(0, 19).replaceAll(":", "-");
    saveBlob(blob, `${this.rig}_${now}.${suffix}`);
  }
}
