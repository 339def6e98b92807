/** The view of calibrations: set one up, guide the participant, see what comes of it. */

import { address } from "../address.js";
import { onSchemeChange } from "../canvas/colours.js";
import { element, say } from "../elements/element.js";
import { active } from "./following.js";
import { Guidance } from "./guidance.js";
import { Setup } from "./setup.js";
import { Shelf } from "./shelf.js";
import { Standing } from "./standing.js";

const LOOK_MS = 300;

export class View {
  /** @param {Element} into @param {import("../views.js").Page} page */
  constructor(into, page) {
    this.into = into;
    this.page = page;
    this.rig = null;
    this.wanted = null;
    this.timer = null;
    const [head, guided, body, setup, shelf] = [1, 2, 3, 4, 5].map(() => element("div"));
    this.guidance = new Guidance(guided);
    this.standing = new Standing(head, body, page, () => this.#changed());
    this.new = element("div", {}, element("h2", {}, "A new calibration"), setup);
    this.setup = new Setup(setup, ({ rig, id }) => {
      location.hash = address("calibrate", rig, id);
      into.scrollIntoView(); // the guidance stands above the form
    });
    this.shelf = new Shelf(shelf);
    this.note = element("p", { class: "quiet" });
    this.below = element("div", { class: "columns" }, this.new, shelf);
    into.append(head, guided, body, this.note, this.below);
    page.link.addEventListener("state", ({ detail }) => this.#trust(detail.state === "open"));
    onSchemeChange(() => (this.guidance.redraw(), this.standing.result.redraw()));
  }

  open(rig, rest) {
    if (rig !== this.rig) this.guidance.lose();
    this.rig = rig;
    this.wanted = rest[0] ?? null;
    this.setup.open(rig);
    this.timer ??= setInterval(() => this.guidance.look(), LOOK_MS);
    this.#showStatus();
    this.#offer();
    // Without a connection nothing is asked: with it, this is called again.
    if (this.page.link.state !== "open") return;
    this.standing.open(this.wanted);
    this.#list();
  }

  close() {
    clearInterval(this.timer);
    this.timer = null;
    this.standing.close();
  }

  hear(message) {
    if (message.rig !== this.rig) return;
    if (message.op === "guidance") this.guidance.take(message.guidance);
    if (message.op === "status" || message.op === "model") this.#showStatus();
    if (message.op === "lost") this.guidance.lose();
  }

  #trust(trusted) {
    this.into.classList.toggle("past", !trusted);
    this.standing.trust(trusted);
  }

  #changed() {
    const { calibration } = this.standing;
    if (calibration !== null && !active(calibration)) this.guidance.lose();
    this.#list();
  }

  #showStatus() {
    const { status } = this.page.state;
    if (status === null) return;
    this.guidance.setScreen(status.screen_mm);
    this.setup.show(status, this.page.link.welcome?.client ?? "");
    this.standing.look();
  }

  #offer() {
    const may = this.page.can("calibrate");
    this.new.hidden = !may;
    this.below.hidden = this.rig === null;
    const known = this.page.link.welcome !== null;
    say(this.note, known && !may ? "A calibration needs the scope calibrate." : "");
  }

  /** Read the list; without an address of its own, the one under way is shown. */
  async #list() {
    const { rig } = this;
    if (rig === null) return;
    await this.shelf.read(rig, this.wanted);
    if (rig !== this.rig || this.wanted !== null || this.timer === null) return;
    const under = this.shelf.calibrations.find(active);
    if (under !== undefined) location.replace(address("calibrate", rig, under.id));
  }
}
