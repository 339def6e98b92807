/** Small pictures of the textures in a list, each drawn once it can be seen. */

import { request } from "../connection/api.js";
import { onSchemeChange } from "../canvas/colours.js";
import { element } from "../elements/element.js";
import { fitted } from "../canvas/scale.js";
import { friction } from "../listening/target.js";
import { readTexture } from "./stored.js";
import { drawWave } from "./waveform.js";

/** What is shown: 10 mm, or what a finger at 50 mm/s feels in as long. */
const WAY_MM = 10;
const SPEED_MM_S = 50;
const POINTS = 240;
/** The first one makes the service load what it compiles textures with. */
const TIMEOUT_MS = 60_000;

export class Thumbnails {
  /** @param {Element} list that scrolls */
  constructor(list) {
    /** By name and etag: what is drawn, samples or an image. */
    this.known = new Map();
    this.last = Promise.resolve();
    this.seen = new IntersectionObserver(
      (entries) => {
        for (const { isIntersecting, target } of entries) if (isIntersecting) this.#draw(target);
      },
      { root: list },
    );
    onSchemeChange(() => {
      for (const canvas of list.querySelectorAll("canvas")) this.#draw(canvas);
    });
  }

  /** The place of a texture's picture. @param {object} summary as the list has it */
  of({ name, etag }) {
    const canvas = element("canvas", { class: "thumbnail", "aria-hidden": "true" });
    Object.assign(canvas.dataset, { name, etag });
    this.seen.observe(canvas);
    return canvas;
  }

  /** One after another: a list asks the service for no more at a time than a hand does. */
  #draw(canvas) {
    this.seen.unobserve(canvas);
    this.last = this.last.then(() => this.#drawn(canvas)).catch(() => {
      delete canvas.dataset.drawn; // damaged, deleted or out of reach: its place stays empty
    });
  }

  async #drawn(canvas) {
    const { name, etag } = canvas.dataset;
    const key = `${name} ${etag}`;
    if (!canvas.isConnected) return;
    if (!this.known.has(key)) {
      const { texture } = await readTexture(name);
      this.known.set(key, await pictureOf(texture));
    }
    const picture = this.known.get(key);
    fitted(canvas);
    if (picture instanceof HTMLImageElement) {
      canvas.getContext("2d").drawImage(picture, 0, 0, canvas.width, canvas.height);
    } else drawWave(canvas, picture);
    canvas.dataset.drawn = "";
  }
}

/** An image of a map; of any other texture the friction along it. */
async function pictureOf(texture) {
  if (texture.kind === "map") {
    const image = new Image();
    image.src = `data:image/png;base64,${texture.image_png}`;
    await image.decode();
    return image;
  }
  if (texture.kind === "profile") return texture.friction_n;
  if (texture.kind === "spectrum") return along(texture);
  const { courses } = await request("POST", "/preview", { json: texture, timeoutMs: TIMEOUT_MS });
  return courses[0].friction_n;
}

/** The friction of a spectrum along its direction, N. Pure. */
export function along(texture) {
  const angle = (texture.angle_deg * Math.PI) / 180;
  const way = Float64Array.from({ length: POINTS }, (_, i) => (WAY_MM * i) / POINTS);
  const path = { x: way.map((s) => s * Math.cos(angle)), y: way.map((s) => s * Math.sin(angle)) };
  const stepS = WAY_MM / SPEED_MM_S / POINTS;
  return friction([{ texture, gain: 1 }], path, 0, stepS, 1, 1);
}
