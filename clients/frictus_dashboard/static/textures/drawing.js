/** Regions drawn, moved and resized on the screen to scale, with a pointer. */

import { onSchemeChange } from "../canvas/colours.js";
import { element } from "../elements/element.js";
import { laid } from "../canvas/scale.js";
import { Surface } from "../live/surface.js";
import { gripAt, LEAST_MM, linesOf, moved, resized, spanned } from "./placing.js";

/** How near to an edge a hand takes hold of it. */
const REACH_PX = 8;
const AXES = ["x_mm", "y_mm"];

export class Drawing {
  /**
   * @param {Element} into
   * @param {{drawn: (place: {x_mm: number[], y_mm: number[]}) => void,
   *   placed: (index: number, place: object, done: boolean) => void}} tell `drawn`: a region was
   *   drawn; `placed`: one is being moved or resized, or was
   */
  constructor(into, tell) {
    this.tell = tell;
    this.enabled = false;
    /** Whether no further region fits into the scene. */
    this.full = false;
    this.regions = [];
    /** What the hand holds: where it began, and the region's edges; null: nothing. */
    this.held = null;
    this.rubber = null;
    this.canvas = element("canvas", { class: "drawing", role: "img" });
    this.canvas.setAttribute("aria-label", "The screen with the regions of the scene below");
    into.append(this.canvas);
    this.surface = new Surface(this.canvas);
    new ResizeObserver(() => this.draw()).observe(this.canvas); // after the surface's own
    onSchemeChange(() => this.draw());
    this.canvas.addEventListener("pointerdown", (event) => this.#down(event));
    this.canvas.addEventListener("pointermove", (event) => this.#move(event));
    this.canvas.addEventListener("pointerup", ({ isPrimary }) => isPrimary && this.#end(true));
    this.canvas.addEventListener("pointercancel", () => this.#end(false));
  }

  /** Width and height; null: not known. */
  get screenMm() {
    return this.surface.screenMm;
  }

  /** @param {boolean} enabled whether regions may be drawn and moved */
  enable(enabled) {
    this.enabled = enabled;
    if (!enabled) this.held = this.rubber = null;
    this.canvas.toggleAttribute("data-drawable", enabled);
  }

  /** @param {[number, number]} screenMm */
  setScreen(screenMm) {
    if (String(screenMm) === String(this.screenMm)) return;
    this.surface.setScreen(screenMm);
    this.draw();
  }

  /** Show regions. @param {object[]} regions as a scene has them */
  show(regions) {
    this.regions = regions;
    this.draw();
  }

  draw() {
    const drawing = this.rubber === null ? [] : [this.rubber];
    this.surface.setRegions([...this.regions, ...drawing]);
    this.surface.draw(performance.now());
  }

  #down(event) {
    if (!this.enabled || event.button !== 0 || !event.isPrimary) return;
    const grip = event.shiftKey ? null : this.#gripAt(event);
    if (grip === null && this.full) return;
    this.canvas.setPointerCapture(event.pointerId);
    const start = this.surface.place(event);
    this.held = { start, grip, region: grip && this.regions[grip.index] };
  }

  #move(event) {
    if (!event.isPrimary) return;
    if (this.held === null) {
      this.canvas.style.cursor = this.enabled ? cursorOf(this.#gripAt(event)) : "";
      return;
    }
    const { start, grip } = this.held;
    const to = this.surface.place(event);
    if (grip !== null) {
      this.held.place = this.#placed(to);
      this.tell.placed(grip.index, this.held.place, false);
      return;
    }
    const lines = AXES.map((axis, i) => linesOf(this.regions, axis, this.screenMm[i]));
    const [x_mm, y_mm] = AXES.map((_, i) => spanned(start[i], to[i], lines[i]));
    this.rubber = { x_mm, y_mm, name: "New" };
    this.draw();
  }

  #end(kept) {
    const { held, rubber } = this;
    this.held = this.rubber = null;
    if (held?.place) {
      const { index } = held.grip;
      const { x_mm, y_mm } = kept ? held.place : held.region;
      this.tell.placed(index, { x_mm, y_mm }, true);
    }
    const large = ([from, to]) => to - from >= LEAST_MM;
    if (kept && rubber !== null && large(rubber.x_mm) && large(rubber.y_mm)) {
      this.tell.drawn({ x_mm: rubber.x_mm, y_mm: rubber.y_mm });
    }
    this.draw();
  }

  /** Where the held region is, with the hand at a place. */
  #placed(to) {
    const { start, grip, region } = this.held;
    const others = this.regions.filter((_, index) => index !== grip.index);
    const edges = [grip.x, grip.y];
    const spans = AXES.map((axis, i) => {
      const lines = linesOf(others, axis, this.screenMm[i]);
      if (edges[i] !== null) return resized(region[axis], edges[i], to[i], lines);
      const whole = edges.every((edge) => edge === null); // else only the other axis is resized
      return whole ? moved(region[axis], to[i] - start[i], lines, this.screenMm[i]) : region[axis];
    });
    return { x_mm: spans[0], y_mm: spans[1] };
  }

  #gripAt(event) {
    if (this.screenMm === null) return null;
    const { width, height } = this.canvas.getBoundingClientRect();
    const reach = REACH_PX / laid(width, height, this.screenMm).perMm;
    return gripAt(this.regions, this.surface.place(event), reach, this.screenMm);
  }
}

function cursorOf(grip) {
  if (grip === null) return "crosshair";
  if (grip.x === null && grip.y === null) return "move";
  if (grip.y === null) return "ew-resize";
  if (grip.x === null) return "ns-resize";
  return grip.x === grip.y ? "nwse-resize" : "nesw-resize";
}
