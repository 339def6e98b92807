/** Be the finger: pointer or arrow keys on the drawn screen move a rig's virtual finger. */

import { at, say } from "../elements/element.js";

const POINT_MS = 15; // at most 60 a second on a display of 60 Hz
const KEY_SPEED_MM_S = 50;
/** So long the finger rests where a key let go of it: from one stroke to the next it stays on. */
const KEY_REST_MS = 1_000;
const KEYS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
const HARDEST_N = 2;

export class Pointing {
  /**
   * @param {import("./surface.js").Surface} surface
   * @param {(message: object) => boolean} send
   * @param {(touching: boolean) => void} changed called when the finger touches or lets go
   */
  constructor(surface, send, changed) {
    this.surface = surface;
    this.send = send;
    this.changed = changed;
    this.enabled = false;
    this.place = null;
    this.pressure = null;
    this.keys = new Set();
    this.restsUntilMs = -Infinity;
    this.sentMs = -Infinity;
    this.touching = false;
    this.slider = at("press");
    this.slider.addEventListener("input", () => this.#label());
    this.#label();
    const { canvas } = surface;
    canvas.addEventListener("pointerdown", (event) => this.#down(event));
    canvas.addEventListener("pointermove", (event) => this.#move(event));
    for (const name of ["pointerup", "pointercancel", "blur"]) {
      canvas.addEventListener(name, () => this.#lift());
    }
    canvas.addEventListener("keydown", (event) => this.#key(event, true));
    canvas.addEventListener("keyup", (event) => this.#key(event, false));
  }

  /** @param {boolean} enabled whether this rig's finger is a pointer's, and may be moved */
  enable(enabled) {
    if (enabled === this.enabled) return;
    this.enabled = enabled;
    const { canvas } = this.surface;
    at("pressing").hidden = !enabled;
    canvas.toggleAttribute("data-live", enabled);
    canvas.setAttribute("role", enabled ? "application" : "img");
    if (enabled) canvas.tabIndex = 0;
    else canvas.removeAttribute("tabindex");
    if (!enabled) this.#lift();
  }

  /** Send where the finger is; call it once per frame. */
  tick(nowMs) {
    const elapsedMs = nowMs - this.sentMs;
    if (!this.enabled || elapsedMs < POINT_MS) return;
    if (this.keys.size > 0) this.restsUntilMs = nowMs + KEY_REST_MS;
    const pressed = this.pressure !== null || nowMs < this.restsUntilMs;
    if (!pressed && !this.touching) return;
    this.#steer(Math.min(elapsedMs, 50));
    this.sentMs = nowMs;
    const changed = pressed !== this.touching;
    this.touching = pressed; // one more point, to lift it
    const [x_mm, y_mm] = this.place;
    const normal_force_n = this.#force();
    this.send({ op: "point", x_mm, y_mm, in_contact: pressed, normal_force_n });
    if (changed) this.changed(pressed);
  }

  #force() {
    // A mouse reports 0.5 at all times, a finger without a sensor 0.
    const felt = this.pressure !== null && ![0, 0.5].includes(this.pressure);
    return felt ? HARDEST_N * this.pressure : Number(this.slider.value);
  }

  #steer(elapsedMs) {
    const [width, height] = this.surface.screenMm;
    this.place ??= [width / 2, height / 2];
    const step = (KEY_SPEED_MM_S * elapsedMs) / 1_000;
    for (const key of this.keys) {
      this.place[0] = Math.min(width, Math.max(0, this.place[0] + step * KEYS[key][0]));
      this.place[1] = Math.min(height, Math.max(0, this.place[1] + step * KEYS[key][1]));
    }
  }

  #down(event) {
    if (!this.enabled || event.button !== 0) return;
    this.surface.canvas.setPointerCapture(event.pointerId);
    this.pressure = event.pressure;
    this.place = this.surface.place(event);
  }

  #move(event) {
    if (this.pressure === null) return;
    this.pressure = event.pressure;
    this.place = this.surface.place(event);
  }

  #lift() {
    this.pressure = null;
    this.keys.clear();
    this.restsUntilMs = -Infinity;
  }

  #key(event, down) {
    if (!this.enabled || !Object.hasOwn(KEYS, event.key)) return;
    event.preventDefault(); // or the page would scroll
    if (down) this.keys.add(event.key);
    else this.keys.delete(event.key);
  }

  #label() {
    say(at("press-value"), `${Number(this.slider.value).toFixed(2)} N`);
  }
}
