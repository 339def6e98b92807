/** Regions drawn on the screen to scale, with a pointer. */

import { onSchemeChange } from "../colours.js";
import { element } from "../element.js";
import { Surface } from "../surface.js";

/** Less is a slip of the hand. */
const LEAST_MM = 1;

export class Drawing {
  /**
   * @param {Element} into
   * @param {(place: {x_mm: number[], y_mm: number[]}) => void} drawn a region was drawn
   */
  constructor(into, drawn) {
    this.drawn = drawn;
    this.enabled = false;
    /** Whether no further region fits into the scene. */
    this.full = false;
    this.regions = [];
    this.start = this.rubber = null;
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

  /** @param {boolean} enabled whether regions may be drawn */
  enable(enabled) {
    this.enabled = enabled;
    if (!enabled) this.start = this.rubber = null;
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
    if (!this.enabled || this.full || event.button !== 0 || !event.isPrimary) return;
    this.canvas.setPointerCapture(event.pointerId);
    this.start = this.surface.place(event);
  }

  #move(event) {
    if (this.start === null || !event.isPrimary) return;
    const [[xFrom, yFrom], [xTo, yTo]] = [this.start, this.surface.place(event)];
    this.rubber = {
      x_mm: between(xFrom, xTo),
      y_mm: between(yFrom, yTo),
      name: "New",
    };
    this.draw();
  }

  #end(kept) {
    const { rubber } = this;
    this.start = this.rubber = null;
    const large = ([from, to]) => to - from >= LEAST_MM;
    if (kept && rubber !== null && large(rubber.x_mm) && large(rubber.y_mm)) {
      this.drawn({ x_mm: rubber.x_mm, y_mm: rubber.y_mm });
    }
    this.draw();
  }
}

/** From the lesser to the greater, in tenths of a millimetre. */
function between(a, b) {
  return [Math.min(a, b), Math.max(a, b)].map((value) => Math.round(10 * value) / 10);
}
