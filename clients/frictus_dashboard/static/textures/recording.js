/** A recording, an effect file or an image, dropped or chosen, becomes a texture. */

import { request } from "../connection/api.js";
import { element, say } from "../elements/element.js";
import { apply, labelled, name, number } from "../elements/fields.js";
import { figure } from "../elements/figures.js";
import { takeDrops } from "../elements/file_drop.js";
import { Outcome } from "../elements/outcome.js";
import { ImageMap, IMAGES } from "./image.js";
import { Trim } from "./trim.js";

const TYPES = {
  wav: "audio/wav",
  csv: "text/csv",
  ahap: "haptics/x-ahap",
  haptic: "haptics/x-haptic",
  hjif: "haptics/hjif",
  hmpg: "haptics/hmpg",
};
const SUFFIXES = [...Object.keys(TYPES), ...IMAGES].map((suffix) => `.${suffix}`);
const TIMEOUT_MS = 30_000;

export class Recording {
  /**
   * @param {Element} into
   * @param {{drafted: (texture: object) => void, saved: (name: string) => void}} tell
   */
  constructor(into, tell) {
    this.into = into;
    this.tell = tell;
    this.file = this.saved = null;
    this.picker = element("input", { type: "file", accept: SUFFIXES.join() });
    this.picker.addEventListener("change", () => this.#take(this.picker.files[0] ?? null));
    this.name = name();
    this.speed = number({ min: 0.001, max: 1000 });
    this.rate = number({ min: 0.001, max: 1e7, optional: true });
    this.scale = number({ min: 1e-9, max: 1e6 });
    this.scale.value = 1;
    this.channel = number({ min: 0, max: 1000, step: 1 });
    this.channel.value = 0;
    this.chosen = element("p", { class: "quiet" });
    this.outcome = new Outcome();
    this.trim = new Trim();
    for (const field of [this.rate, this.channel]) {
      field.addEventListener("change", () => this.#showPart());
    }
    this.form = this.#form();
    this.form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.#save();
    });
    into.append(
      element(
        "p",
        { class: "quiet" },
        "Drop a recording (WAV, CSV), a haptic effect (AHAP, .haptic, HJIF) or an image " +
          "anywhere here, or choose one.",
      ),
      element("div", { class: "fields" }, labelled("File", this.picker)),
      this.chosen,
      this.form,
      this.outcome.root,
    );
    this.image = new ImageMap(into, tell);
    this.#take(null);
  }

  /** Take what is dropped while the view is shown. @param {AbortSignal} signal until then */
  listen(signal) {
    const take = (dropped) => {
      this.picker.value = "";
      this.#take(dropped[0] ?? null);
      if (dropped.length > 1) this.outcome.bad("One file at a time: the first was taken");
    };
    takeDrops(this.into, take, signal);
  }

  #form() {
    this.ofCsv = labelled("Sample rate, Hz (of a single column)", this.rate);
    this.ofWav = labelled("Channel", this.channel);
    this.unit = element("span");
    this.meaning = element("span");
    const scale = element("label", {}, this.unit, this.scale);
    const fields = [
      labelled("Name in the library", this.name),
      element("label", {}, this.meaning, this.speed),
      this.ofCsv,
      this.ofWav,
      scale,
      this.trim.root,
    ];
    const save = element("button", { type: "submit" }, "Make it a texture");
    return element("form", { class: "fields" }, ...fields, save);
  }

  #take(file) {
    const suffix = file === null ? "" : file.name.split(".").pop().toLowerCase();
    const known = suffix in TYPES;
    this.outcome.clear();
    this.form.hidden = !known;
    this.file = known ? file : null;
    this.trim.clear();
    this.image.clear();
    if (IMAGES.includes(suffix)) {
      say(this.chosen, "");
      this.image.take(file, nameOf(file.name));
      return;
    }
    say(this.chosen, known ? `${file.name}, ${figure(file.size / 1e3, 3)} kB` : "");
    if (file !== null && !known) this.outcome.bad(`${file.name}: ${SUFFIXES.join(", ")} are read`);
    if (!known) return;
    this.suffix = suffix;
    this.type = TYPES[suffix];
    apply(this.ofCsv, suffix === "csv");
    apply(this.ofWav, suffix === "wav");
    const effect = suffix !== "csv" && suffix !== "wav";
    this.speed.required = !effect;
    if (effect) this.speed.value = ""; // that of an earlier file would lay it out over position
    say(
      this.meaning,
      effect
        ? "Speed at which it is felt in its own time, mm/s (empty: over time)"
        : "Speed of the recording, mm/s",
    );
    say(this.unit, suffix === "csv" ? "Newtons per unit" : "Newtons at full scale");
    this.#showPart();
    this.name.value = nameOf(file.name);
    this.speed.focus();
    this.speed.select(); // typing replaces that of an earlier file
  }

  #showPart() {
    const rateHz = this.rate.value === "" ? null : this.rate.valueAsNumber;
    const how = { channel: this.channel.valueAsNumber, rateHz };
    if (this.file !== null) this.trim.show(this.file, this.suffix, how);
  }

  async #save() {
    const { file } = this;
    if (file === this.saved) return; // it is on its way
    this.saved = file;
    const { type, rate, speed } = this;
    const query = new URLSearchParams({
      scale_n: this.scale.value,
      ...this.trim.query,
      ...(speed.value !== "" ? { recording_speed_mm_s: speed.value } : {}),
      ...(type === TYPES.wav ? { channel: this.channel.value } : {}),
      ...(type === TYPES.csv && rate.value !== "" ? { sample_rate_hz: rate.value } : {}),
    });
    const sent = request("PUT", `/textures/${this.name.value}?${query}`, {
      body: file,
      headers: { "Content-Type": this.type, "If-None-Match": "*" },
      timeoutMs: TIMEOUT_MS,
    });
    const made = await this.outcome.of(sent, `${file.name} is not a texture yet`);
    if (this.saved === file) this.saved = null;
    if (made === null) return;
    if (this.file === file) {
      this.picker.value = "";
      this.#take(null);
    }
    this.outcome.good(
      [`${file.name} is in the library as ${made.name}`, ...made.notes].join("; "),
    );
    this.tell.saved(made.name);
  }
}

/** A name that the library takes, after that of a file. */
export function nameOf(file) {
  const stem = file.replace(/\.[^.]*$/, "").toLowerCase();
  return stem.replace(/[^a-z0-9_-]+/g, "-").replace(/^[-_]+/, "").slice(0, 64);
}
