/** A scene for a rig: regions drawn or typed, each with a texture; applied by hand. */

import { element, say } from "../elements/element.js";
import { button, labelled } from "../elements/fields.js";
import { Outcome } from "../elements/outcome.js";
import { Drawing } from "./drawing.js";
import { RegionFields, WHOLE } from "./region.js";
import { rendered, replaceScene, sceneIn, words } from "./scene.js";
import { same, Undo } from "./undo.js";

const HOW =
  "Drag on the screen to draw a region, or add one. Drag a region to move it, or its edges to " +
  "resize it; edges snap to others (with Shift, one is drawn inside another).";
/** As many as a scene holds. */
const MOST = 32;

export class Regions {
  /** @param {Element} into @param {import("../views.js").Page} page */
  constructor(into, page) {
    this.page = page;
    this.rig = this.applying = null;
    this.names = [];
    this.now = element("p");
    this.mark = element("p", { "data-unapplied": "" });
    this.note = element("p", { class: "quiet" });
    this.outcome = new Outcome();
    const drawn = element("div");
    this.drawing = new Drawing(drawn, {
      drawn: (place) => this.#add(place),
      placed: (index, place, done) => this.#place(index, place, done),
    });
    this.undo = new Undo((state) => this.#restore(state));
    drawn.append(this.mark, this.note);
    this.list = element("div", { class: "regions" });
    this.name = element("input", { type: "text", maxlength: 100 });
    this.form = this.#form();
    into.append(this.now, element("div", { class: "columns" }, drawn, this.form));
    this.#begin();
  }

  /**
   * Show the scene of a rig.
   *
   * @param {string|null} rig
   * @param {string[]} names textures of the library
   * @param {string|null} chosen the one that new regions get
   */
  open(rig, names, chosen) {
    this.chosen = chosen;
    if (rig !== this.rig) {
      this.rig = rig;
      this.#begin();
    }
    if (String(names) !== String(this.names)) {
      this.names = names;
      for (const row of this.rows) row.offer(names);
    }
    this.hear();
  }

  /** The rig has said something new. */
  hear() {
    const { status, scene } = this.page.state;
    if (status !== null) this.drawing.setScreen(status.screen_mm);
    // What was applied here is newer than what had been seen of the rig before.
    if (status !== null && scene !== null && scene !== this.seen) {
      this.seen = scene;
      const other = scene.etag !== this.etag;
      this.overtaken = other && this.touched;
      if (other && !this.touched) {
        this.outcome.clear();
        this.#take();
      }
    }
    const may = this.page.can("render") && this.etag !== null;
    this.form.hidden = !may;
    this.apply.disabled = this.page.keptOut !== "";
    this.drawing.enable(may);
    this.drawing.canvas.hidden = this.etag === null;
    this.look();
  }

  /** Tell what the rig renders, as far as that is known at this moment. */
  look() {
    const { rig, page } = this;
    const { status, scene } = page.state;
    const alive = page.link.state === "open" && page.live.alive;
    const known = alive && status !== null && scene !== null;
    if (rig === null) say(this.now, "No rig is present.");
    else say(this.now, known ? rendered(rig, page.state) : `What ${rig} renders is not known.`);
    this.#tell();
  }

  #form() {
    const add = button("Add a region", () => {
      const [width, height] = this.drawing.screenMm;
      this.#add({ x_mm: [width / 4, width / 2], y_mm: [height / 4, height / 2] }).name.focus();
    });
    const whole = button("Add the whole screen", () => this.#add(WHOLE).name.focus());
    const take = button("Take the rig's scene", () => {
      this.outcome.clear();
      this.#take();
      this.look();
    });
    this.apply = element("button", { type: "submit" }, "Apply the scene");
    this.adders = [add, whole];
    const buttons = element("p", { class: "actions-row" }, add, whole, take, this.apply);
    buttons.append(this.undo.root);
    const named = element("div", { class: "fields" }, labelled("Name of the scene", this.name));
    const form = element("form", {}, named, this.list, buttons, this.outcome.root);
    form.addEventListener("input", () => this.#touch());
    form.addEventListener("change", () => this.undo.note(this.#state()));
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.#apply();
    });
    return form;
  }

  /** Nothing is known of the rig's scene. */
  #begin() {
    this.seen = this.etag = null;
    this.outcome.clear();
    this.#put("", []);
  }

  /** Begin with what the rig renders. */
  #take() {
    const { etag, scene } = this.page.state.scene;
    this.etag = etag;
    this.#put(scene.name, scene.regions);
  }

  #put(name, regions) {
    this.touched = this.overtaken = false;
    /** Counts changes: what was changed while a scene was on its way is not applied. */
    this.edition = 0;
    this.#fill(name, regions.map((region) => this.#fields(region)));
    /** What the rig has. */
    this.applied = this.#state();
    this.undo.begin(this.applied);
    this.#number();
  }

  #fill(name, rows) {
    this.name.value = name;
    this.rows = rows;
    this.list.replaceChildren(...rows.map(({ root }) => root));
  }

  #state() {
    return { name: this.name.value, rows: this.rows.map((row) => row.snapshot()) };
  }

  #restore({ name, rows }) {
    this.#fill(name, rows.map(({ region, chosen }) => {
      const row = this.#fields(region);
      row.choose(chosen);
      return row;
    }));
    this.#touch();
  }

  /** A region is moved or resized by hand. */
  #place(index, place, done) {
    this.rows[index].place(place);
    this.#touch();
    if (done) this.undo.note(this.#state());
  }

  #fields(region) {
    const { screenMm } = this.drawing;
    const row = new RegionFields(region, screenMm, () => this.#remove(row));
    row.offer(this.names);
    return row;
  }

  #add(place) {
    const row = this.#fields({ ...place, texture: null });
    this.rows.push(row);
    this.list.append(row.root);
    row.choose(this.chosen);
    this.#touch();
    this.undo.note(this.#state());
    return row;
  }

  #remove(row) {
    const at = this.rows.indexOf(row);
    this.rows.splice(at, 1);
    row.root.remove();
    this.#touch();
    this.undo.note(this.#state());
    const next = this.rows[at] ?? this.rows[at - 1];
    (next?.name ?? this.adders[0]).focus();
  }

  #number() {
    const { rows } = this.applied;
    this.rows.forEach((row, i) => row.number(i, !same(row.snapshot(), rows[i])));
    this.drawing.full = this.rows.length >= MOST;
    for (const add of this.adders) add.disabled = this.drawing.full;
    this.drawing.show(this.rows.map((row) => row.sketch()));
  }

  #touch() {
    this.touched = true;
    this.edition += 1;
    this.#number();
    this.#tell();
  }

  #tell() {
    const said = [];
    say(this.mark, this.etag !== null && this.touched ? "Not applied yet." : "");
    if (this.etag !== null) {
      if (!this.touched) said.push("Drawn as the rig has it.");
      if (this.overtaken) said.push("The rig's scene has changed since this one was begun.");
    }
    if (this.page.can("render")) said.push(this.page.keptOut);
    if (this.drawing.full) said.push(`A scene has at most ${MOST} regions.`);
    else if (this.drawing.enabled) said.push(HOW);
    say(this.note, said.join(" "));
  }

  async #apply() {
    const { rig, edition } = this;
    if (rig === this.applying) return; // it is on its way
    const sent = this.#state();
    const before = this.page.state.scene;
    this.applying = rig;
    const done = await this.outcome.of(this.#send(rig), `Not applied to ${rig}`);
    if (this.applying === rig) this.applying = null;
    if (done === null) return;
    this.outcome.good(`${rig} renders it: ${words(done.applied)}`);
    if (rig !== this.rig) return;
    this.etag = done.etag;
    this.touched = edition !== this.edition;
    this.overtaken = false;
    this.seen = before;
    this.applied = sent;
    this.#number();
    this.hear();
  }

  /** Send it; whoever has read of a conflict may replace what stands there by then. */
  async #send(rig) {
    const { etag } = this;
    const name = this.name.value;
    const regions = await Promise.all(this.rows.map((row) => row.read()));
    const scene = { name, regions };
    try {
      const asked = replaceScene(rig, scene, etag);
      return await this.page.settled(asked, this.outcome, rig, sceneIn(scene));
    } catch (error) {
      if (error.code !== "conflict" || rig !== this.rig) throw error;
      this.etag = this.page.state.scene?.etag ?? this.etag;
      throw new Error(`${error.message}. Apply again to replace what stands there now`);
    }
  }
}
