/** The fields of one region of a scene. */

import { element, say } from "../elements/element.js";
import { button, choice, labelled, number, optionsOf } from "../elements/fields.js";
import { regionColour } from "../live/surface.js";
import { readTexture } from "./stored.js";

/** Reaches past any screen: no edge is met. */
export const WHOLE = { x_mm: [-1_000, 1_000], y_mm: [-1_000, 1_000] };
/** The texture that the region came with. */
const KEPT = "";

export class RegionFields {
  /**
   * @param {object} region as a scene has it; `texture` null: to be chosen
   * @param {[number, number]} screenMm
   * @param {() => void} removed called when it shall go
   */
  constructor(region, screenMm, removed) {
    const fade = region.edge_fade_mm ?? 1;
    this.region = region;
    this.legend = element("legend");
    this.name = element("input", { type: "text", maxlength: 100 });
    this.name.value = region.name ?? "";
    this.texture = choice([]);
    this.texture.required = region.texture === null;
    this.whole = element("input", { type: "checkbox" });
    this.whole.checked = covers(region, fade, screenMm);
    const shown = this.whole.checked
      ? { x_mm: [0, screenMm[0]], y_mm: [0, screenMm[1]] }
      : region;
    this.places = ["x_mm", "y_mm"].flatMap((axis) =>
      [0, 1].map((end) => {
        const control = number();
        control.value = shown[axis][end];
        return control;
      }),
    );
    this.gain = number({ min: 0, max: 100 });
    this.gain.value = region.gain ?? 1;
    this.fade = number({ min: 0, max: 50 });
    this.fade.value = fade;
    const remove = button("Remove the region", removed);
    this.root = element("fieldset", { class: "region" }, this.legend, this.#fields(), remove);
    this.root.addEventListener("input", () => this.#judge());
    this.#judge();
  }

  /** @param {number} index from 0 @param {boolean} changed whether the rig has another */
  number(index, changed) {
    say(this.legend, `Region ${index + 1}${changed ? " · not applied" : ""}`);
    this.legend.toggleAttribute("data-unapplied", changed);
    this.root.style.borderInlineStartColor = `var(${regionColour(index)})`;
  }

  /** Put it somewhere else. @param {{x_mm: number[], y_mm: number[]}} place */
  place({ x_mm, y_mm }) {
    [...x_mm, ...y_mm].forEach((value, i) => (this.places[i].value = value));
    this.#judge();
  }

  /** What `restored` makes the same fields of. */
  snapshot() {
    return { region: { ...this.#own(), texture: this.region.texture }, chosen: this.texture.value };
  }

  /** Offer textures, and keep the one that is chosen if it is among them. */
  offer(names) {
    const chosen = this.texture.value;
    const kept = this.region.texture;
    const first = kept ? `as it is (${kept.kind})` : "choose…";
    this.texture.replaceChildren(
      ...optionsOf([[KEPT, first], ...names.map((name) => [name, name])]),
    );
    this.choose(chosen);
  }

  /** Assign a texture of those offered; any other is none. @param {string|null} name */
  choose(name) {
    const offered = [...this.texture.options].some(({ value }) => value === name);
    this.texture.value = offered ? name : KEPT;
  }

  /** As the drawing shows it; its texture by name only. */
  sketch() {
    const kind = this.texture.value || this.region.texture?.kind || "no texture yet";
    return { ...this.#place(), name: this.name.value, texture: { kind } };
  }

  /** As the scene gets it, as its fields are now. */
  async read() {
    const { value: name } = this.texture;
    const region = this.#own();
    const texture = name === KEPT ? this.region.texture : (await readTexture(name)).texture;
    return { ...region, texture };
  }

  #own() {
    return {
      ...this.#place(),
      gain: this.gain.valueAsNumber,
      edge_fade_mm: this.fade.valueAsNumber,
      name: this.name.value,
    };
  }

  #fields() {
    const [left, right, top, bottom] = this.places;
    return element(
      "div",
      { class: "fields" },
      labelled("Name", this.name),
      labelled("Texture", this.texture),
      labelled("Whole screen", this.whole),
      labelled("x from, mm", left),
      labelled("x to, mm", right),
      labelled("y from, mm", top),
      labelled("y to, mm", bottom),
      labelled("Gain", this.gain),
      labelled("Edge fade, mm", this.fade),
    );
  }

  #place() {
    if (this.whole.checked) return WHOLE;
    const [left, right, top, bottom] = this.places.map((control) => control.valueAsNumber);
    return { x_mm: [left, right], y_mm: [top, bottom] };
  }

  #judge() {
    for (const control of this.places) control.disabled = this.whole.checked;
    const [left, right, top, bottom] = this.places;
    for (const [from, to] of [[left, right], [top, bottom]]) {
      const wrong = from.valueAsNumber >= to.valueAsNumber;
      to.setCustomValidity(wrong ? "It has to end behind where it begins" : "");
    }
  }
}

/** Whether no part of the screen lies outside, or where the texture fades in at an edge. */
function covers({ x_mm: [left, right], y_mm: [top, bottom] }, fade, [width, height]) {
  const beyond = (from, to, end) => from + fade <= 0 && to - fade >= end;
  return beyond(left, right, width) && beyond(top, bottom, height);
}
