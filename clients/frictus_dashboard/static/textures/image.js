/** An image becomes a map: its grey, from black to white, is friction. */

import { element, say } from "../elements/element.js";
import { labelled, name, number } from "../elements/fields.js";
import { Outcome } from "../elements/outcome.js";
import { saveTexture } from "./stored.js";

export const IMAGES = ["png", "jpg", "jpeg", "webp"];
/** A quarter of what a map may have: 0.2 mm a grey on the usual screen, and quickly on a rig. */
const MOST_PIXELS = 65_536;
/** Larger files are no pictures of a texture. */
const MOST_BYTES = 50e6;

export class ImageMap {
  /**
   * @param {Element} into
   * @param {{drafted: (texture: object) => void, saved: (name: string) => void}} tell
   */
  constructor(into, tell) {
    this.tell = tell;
    this.name = name();
    this.black = number({ min: -10, max: 10 });
    this.white = number({ min: -10, max: 10 });
    this.black.value = 0;
    this.white.value = 0.05;
    this.chosen = element("p", { class: "quiet", role: "status" });
    this.outcome = new Outcome();
    const save = element("button", { type: "submit" }, "Make it a map");
    this.form = element(
      "form",
      { class: "fields" },
      labelled("Name of the map", this.name),
      labelled("Friction of black, N", this.black),
      labelled("Friction of white, N", this.white),
      save,
    );
    for (const field of [this.black, this.white]) {
      field.addEventListener("change", () => field.validity.valid && tell.drafted(this.#texture()));
    }
    this.form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.#save();
    });
    into.append(this.chosen, this.form, this.outcome.root);
    this.clear();
  }

  clear() {
    this.asked = this.png = null;
    this.form.hidden = true;
    say(this.chosen, "");
    this.outcome.clear();
  }

  /** Take an image. @param {File} file @param {string} called the name it begins with */
  async take(file, called) {
    this.clear();
    const asked = (this.asked = {});
    const found = await greyOf(file);
    if (asked !== this.asked) return;
    if (found === null) {
      this.outcome.bad(`${file.name} cannot be read as an image`);
      return;
    }
    this.png = found.png;
    this.name.value = called;
    const { width, height, scaled } = found;
    const how = scaled ? ", scaled down: finer would not be felt" : "";
    say(this.chosen, `${file.name}, ${width} × ${height} greys${how}`);
    this.form.hidden = false;
    this.white.focus();
    this.white.select();
    this.tell.drafted(this.#texture());
  }

  #texture() {
    const [black_n, white_n] = [this.black.valueAsNumber, this.white.valueAsNumber];
    return { kind: "map", image_png: this.png, black_n, white_n };
  }

  async #save() {
    const called = this.name.value;
    const { asked } = this;
    if (asked === null) return; // it is on its way
    this.asked = null;
    const etag = await this.outcome.of(saveTexture(called, this.#texture(), null), "Not saved");
    if (etag === null) {
      this.asked ??= asked;
      return;
    }
    if (this.asked === null) this.clear();
    this.outcome.good(`The image is in the library as ${called}`);
    this.tell.saved(called);
  }
}

/**
 * The grey of an image as a base64 PNG, no larger than a map may be, where it is clear as on white.
 *
 * @param {Blob} file
 * @returns {Promise<{png: string, width: number, height: number, scaled: boolean}|null>} null:
 *   it is no image
 */
export async function greyOf(file) {
  if (file.size > MOST_BYTES) return null;
  let image;
  try {
    image = await createImageBitmap(file);
  } catch {
    return null;
  }
  const share = Math.min(1, Math.sqrt(MOST_PIXELS / (image.width * image.height)));
  const sides = [image.width, image.height];
  const [width, height] = sides.map((n) => Math.max(1, Math.floor(share * n)));
  const canvas = new OffscreenCanvas(width, height);
  const pen = canvas.getContext("2d");
  pen.fillStyle = "white";
  pen.fillRect(0, 0, width, height);
  pen.drawImage(image, 0, 0, width, height);
  image.close();
  const pixels = pen.getImageData(0, 0, width, height);
  for (let i = 0; i < pixels.data.length; i += 4) {
    const [red, green, blue] = pixels.data.subarray(i, i + 3);
    pixels.data.fill(Math.round(0.2126 * red + 0.7152 * green + 0.0722 * blue), i, i + 3);
  }
  pen.putImageData(pixels, 0, 0);
  const png = await base64(await canvas.convertToBlob({ type: "image/png" }));
  return { png, width, height, scaled: share < 1 };
}

function base64(blob) {
  return new Promise((resolve) => {
    const reader = new FileReader();
    reader.addEventListener("load", () => resolve(reader.result.split(",")[1]));
    reader.readAsDataURL(blob);
  });
}
