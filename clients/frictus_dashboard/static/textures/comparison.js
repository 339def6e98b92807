/** A against B on the rig: two textures, or one with compensation and without. */

import { switchTo } from "../rig/compensation.js";
import { element, say } from "../elements/element.js";
import { button, choice, labelled, optionsOf } from "../elements/fields.js";
import { Outcome } from "../elements/outcome.js";
import { replaceScene, sceneIn, words } from "./scene.js";
import { readTexture } from "./stored.js";

const MODES = [
  ["model", "Compensated"],
  ["none", "Not compensated"],
];

export class Comparison {
  /** @param {Element} into @param {import("../views.js").Page} page */
  constructor(into, page) {
    this.page = page;
    this.rig = null;
    this.names = [];
    this.into = into;
    this.sides = ["A", "B"].map((letter) => this.#side(letter));
    this.modes = MODES.map(([mode, text]) => {
      return { mode, button: button(text, () => this.#switch(mode)) };
    });
    this.compensation = group("Compensation", ...this.modes.map((each) => each.button));
    this.note = element("p", { class: "quiet" });
    this.outcome = new Outcome();
    const textures = this.sides.map(({ root }) => root);
    into.append(...textures, this.compensation, this.note, this.outcome.root);
  }

  /**
   * @param {string|null} rig
   * @param {string[]} names textures of the library
   * @param {string|null} chosen what A begins with
   */
  open(rig, names, chosen) {
    if (rig !== this.rig) this.outcome.clear();
    this.rig = rig;
    if (String(names) !== String(this.names)) {
      this.names = names;
      const first = names.includes(chosen) ? chosen : (names[0] ?? "");
      const other = names.find((name) => name !== first) ?? "";
      this.sides.forEach((side, i) => {
        const kept = side.select.value;
        side.select.replaceChildren(...optionsOf(names.map((name) => [name, name])));
        side.select.value = names.includes(kept) ? kept : [first, other][i];
      });
    }
    this.hear();
  }

  /** The rig has said something new: what is pressed is in force. */
  hear() {
    const { page, rig } = this;
    const { status } = page.state;
    const known = rig !== null && status !== null;
    this.into.hidden = !(page.can("render") && known && this.names.length > 1);
    if (this.into.hidden) return;
    const armed = status.state === "armed";
    for (const { scene, button: feel } of this.sides) {
      feel.disabled = page.keptOut !== "";
      press(feel, scene !== null && sceneIn(scene)(page.state) !== null);
    }
    for (const { mode, button: chosen } of this.modes) {
      chosen.disabled = page.keptOut !== "" || !armed;
      press(chosen, armed && status.compensation.mode === mode);
    }
    const idle = armed ? "" : `${rig} is not armed: arm it to feel them and to switch compensation.`;
    say(this.note, page.keptOut || idle);
  }

  #side(letter) {
    const select = choice([]);
    const side = { select, scene: null, button: button(`Feel ${letter}`, () => this.#feel(side)) };
    select.addEventListener("change", () => {
      side.scene = null;
      this.hear();
    });
    side.root = group(`Texture ${letter}`, labelled(`Texture ${letter}`, select), side.button);
    return side;
  }

  async #feel(side) {
    const { rig } = this;
    const name = side.select.value;
    const felt = await this.outcome.of(this.#send(rig, name, side), `${name} is not on ${rig}`);
    if (felt !== null) this.outcome.good(`${name} is on ${rig}: ${words(felt.applied)}`);
    this.hear();
  }

  async #send(rig, name, side) {
    const { texture } = await readTexture(name);
    const scene = { name, regions: [{ name, texture }] };
    if (side.select.value === name) side.scene = scene;
    return this.page.settled(replaceScene(rig, scene, "*"), this.outcome, rig, sceneIn(scene));
  }

  async #switch(mode) {
    const told = await switchTo(this.rig, { mode });
    if (told === "") this.outcome.clear();
    else this.outcome.bad(told);
  }
}

function press(control, pressed) {
  control.setAttribute("aria-pressed", String(pressed));
}

function group(name, ...parts) {
  return element("div", { class: "fields", role: "group", "aria-label": name }, ...parts);
}
