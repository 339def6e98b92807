/** An editor for spectrum, beta and slope textures; saved to the library. */

import { element, say } from "../elements/element.js";
import { button, choice, labelled, name, number, numberIn } from "../elements/fields.js";
import { Outcome } from "../elements/outcome.js";
import { Components } from "./components.js";
import { etagOf, saveTexture } from "./stored.js";
import { same, Undo } from "./undo.js";

const PAUSE_MS = 400;
const KINDS = [
  ["spectrum", "Spectrum: components"],
  ["beta", "Beta: a hump of its own width and skew"],
  ["slope", "Slope: noise around a peak"],
];
const RMS = ["rms_n", "Strength, N rms", { min: 1e-6, max: 10 }];
const SEED = ["seed", "Seed of the phases", { min: 0, max: Number.MAX_SAFE_INTEGER, step: 1 }];
const SPEED = [
  "speed_mm_s",
  "Felt so at, mm/s (empty: over time)",
  { min: 0.001, max: 1000, optional: true },
];
const ANGLE = ["angle_deg", "Direction, °", { min: -360, max: 360 }];
const FIELDS = {
  spectrum: [ANGLE],
  beta: [
    ["alpha", "Alpha", { min: 0.01, max: 1000 }],
    ["beta", "Beta", { min: 0.01, max: 1000 }],
    RMS,
    SPEED,
    SEED,
    ANGLE,
  ],
  slope: [
    ["peak_hz", "Peak, Hz", { min: 20, max: 1000 }],
    ["low_order", "Order below the peak", { min: 1, max: 8, step: 1 }],
    ["high_order", "Order above the peak", { min: 1, max: 8, step: 1 }],
    RMS,
    SPEED,
    SEED,
    ANGLE,
  ],
};
/** To begin with. */
const FRESH = {
  spectrum: {
    kind: "spectrum",
    components: [{ amplitude_n: 0.05, cycles_per_mm: 1, phase_rad: 0 }],
    angle_deg: 0,
  },
  beta: { kind: "beta", alpha: 3, beta: 3, rms_n: 0.05, speed_mm_s: 50, seed: 0, angle_deg: 0 },
  slope: {
    kind: "slope",
    peak_hz: 200,
    low_order: 2,
    high_order: 2,
    rms_n: 0.05,
    speed_mm_s: 50,
    seed: 0,
    angle_deg: 0,
  },
};

export class Editor {
  /**
   * @param {Element} into
   * @param {{drafted: (texture: object) => void, closed: () => void,
   *   saved: (name: string) => void}} tell
   */
  constructor(into, tell) {
    this.into = into;
    this.tell = tell;
    this.title = element("h2");
    this.name = name();
    this.kind = choice(KINDS);
    this.kind.addEventListener("change", () => {
      this.#fill(FRESH[this.kind.value]);
      this.#draft();
    });
    this.fields = element("div", { class: "fields" });
    this.spectrum = element("div");
    this.components = new Components(this.spectrum, () => this.#draft());
    this.outcome = new Outcome();
    this.undo = new Undo((texture) => this.#restore(texture));
    this.unsaved = element("p", { "data-unapplied": "" }, "Not saved yet.");
    this.faults = element("p", { class: "outcome", role: "status", "data-outcome": "bad" });
    const head = [labelled("Name in the library", this.name), labelled("Kind", this.kind)];
    const save = element("button", { type: "submit" }, "Save to the library");
    this.form = element(
      "form",
      {},
      element("div", { class: "fields" }, ...head),
      this.fields,
      this.spectrum,
      this.faults,
      this.unsaved,
      element(
        "p",
        { class: "actions-row" },
        save,
        button("Close", () => this.close()),
        this.undo.root,
      ),
      this.outcome.root,
    );
    this.form.addEventListener("input", ({ target }) => {
      if (target !== this.name && target !== this.kind) this.#draft();
    });
    this.form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.#save();
    });
    into.append(this.title, this.form);
    into.hidden = true;
  }

  /** Whether a texture of the library can be edited here. */
  static takes(texture) {
    return texture.kind in FIELDS;
  }

  /** Begin a new texture. */
  fresh() {
    this.#open("A new texture", "", FRESH.spectrum, null);
    this.#draft();
  }

  /** Edit a texture. @param {string|null} etag what it replaces; null: a copy is edited */
  edit(given, texture, etag) {
    if (etag !== null) this.#open(`Edit ${given}`, given, texture, etag);
    else this.#open(`A copy of ${given}`, `${given.slice(0, 59)}-copy`, texture, null);
  }

  close() {
    if (this.into.hidden) return;
    clearTimeout(this.pause);
    this.into.hidden = true;
    this.tell.closed();
  }

  #open(title, called, texture, etag) {
    clearTimeout(this.pause);
    /** What saving under this name replaces, and whether that is under way. */
    this.begun = { name: called, etag, saving: false };
    say(this.title, title);
    this.name.value = called;
    this.kind.value = texture.kind;
    this.outcome.clear();
    say(this.faults, "");
    this.into.hidden = false;
    this.#fill(texture);
    /** As the library has it; null: it does not. */
    this.saved = etag === null ? null : this.#read();
    this.undo.begin(this.#read());
    this.#mark();
    this.name.focus();
  }

  #fill(texture) {
    this.base = texture;
    this.spectrum.hidden = texture.kind !== "spectrum";
    this.components.show(texture.components ?? []);
    this.controls = FIELDS[texture.kind].map(([key, text, limits]) => {
      const control = number(limits);
      control.value = texture[key] ?? "";
      return { key, control, label: labelled(text, control) };
    });
    this.fields.replaceChildren(...this.controls.map(({ label }) => label));
  }

  #read() {
    const texture = { ...this.base };
    for (const { key, control } of this.controls) texture[key] = numberIn(control);
    if (texture.kind === "spectrum") texture.components = this.components.read();
    return texture;
  }

  /** Tell of a change once the hand rests. */
  #draft() {
    clearTimeout(this.pause);
    this.#mark();
    this.pause = setTimeout(() => {
      const faulty = [...this.form.elements].find(
        (control) => control !== this.name && !control.validity.valid,
      );
      say(this.faults, faulty === undefined ? "" : passedOver(faulty));
      if (faulty !== undefined) return;
      this.undo.note(this.#read());
      this.tell.drafted(this.#read());
    }, PAUSE_MS);
  }

  #restore(texture) {
    clearTimeout(this.pause);
    this.kind.value = texture.kind;
    this.#fill(texture);
    say(this.faults, "");
    this.#mark();
    this.tell.drafted(texture);
  }

  #mark() {
    this.unsaved.hidden = same(this.#read(), this.saved);
  }

  async #save() {
    const { begun } = this;
    const called = this.name.value;
    if (begun.saving) return;
    clearTimeout(this.pause);
    begun.saving = true;
    const texture = this.#read();
    const etag = await this.outcome.of(put(called, texture, begun), "Not saved");
    begun.saving = false;
    if (etag === null) return;
    Object.assign(begun, { name: called, etag });
    this.outcome.good(`${called} is saved`);
    if (begun === this.begun) {
      say(this.title, `Edit ${called}`);
      this.saved = texture;
      this.#mark();
    }
    this.tell.saved(called);
  }
}

/** What is told while a field cannot be read. @param {HTMLInputElement} control */
function passedOver(control) {
  const named = control.ariaLabel ?? control.labels[0].textContent;
  return `${named}: ${control.validationMessage} The preview is of the draft before.`;
}

/** Save; whoever has read of a conflict may replace what stands there by then. */
async function put(called, texture, begun) {
  const etag = begun.name === called ? begun.etag : null;
  try {
    return await saveTexture(called, texture, etag);
  } catch (error) {
    if (etag === null || error.code !== "conflict") throw error;
    begun.etag = await etagOf(called);
    throw new Error(`${error.message}. Save again to replace what stands there now`);
  }
}
