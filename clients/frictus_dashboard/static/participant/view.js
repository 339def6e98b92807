/** The participant's page: instruction, question and answers, and nothing else but the stop. */

import { request } from "../connection/api.js";
import { Guidance } from "../calibrate/guidance.js";
import { element, say } from "../elements/element.js";
import { active, Following, send } from "../experiment/following.js";
import { button } from "../elements/fields.js";
import { Outcome } from "../elements/outcome.js";
import { answerOf, screenOf } from "./screen.js";

/** How often it is looked whether an experiment has begun. */
const LOOK_MS = 1_000;
const GUIDANCE_MS = 300;

export class View {
  #timers = [];
  #following = null;
  #keys = (event) => this.#press(event);

  /** @param {HTMLElement} into @param {import("../views.js").Page} page */
  constructor(into, page) {
    this.page = page;
    this.rig = null;
    this.job = null;
    this.shown = screenOf(null, { connected: false, may: false });
    /** The experiment that was followed here; the end of another is nobody's here. */
    this.followed = null;
    /** The question that is asked, and whether it was answered: it takes one answer. */
    this.question = "";
    this.answered = false;
    this.title = element("h2", { "aria-live": "polite" });
    this.text = element("p", { class: "how", role: "status" });
    this.answers = element("div", { class: "answers" });
    this.progress = element("progress", { max: "1", "aria-label": "How much is done" });
    this.outcome = new Outcome();
    this.full = button("Full screen", () => document.documentElement.requestFullscreen());
    const guided = element("div");
    this.guidance = new Guidance(guided);
    this.asked = element("div", { class: "asked" }, this.title, this.text, this.answers);
    into.append(guided, this.asked, this.outcome.root, this.progress, this.full);
    document.addEventListener("fullscreenchange", () => this.#draw());
    page.link.addEventListener("state", () => this.#draw());
  }

  open(rig) {
    // Called anew after a reconnection: what was followed before may hang without an end.
    this.#unfollow();
    if (rig !== this.rig) {
      this.job = null;
      this.guidance.lose();
    }
    this.rig = rig;
    const { status } = this.page.state;
    if (status !== null) this.guidance.setScreen(status.screen_mm);
    if (this.#timers.length === 0) {
      this.#timers.push(setInterval(() => this.#look(), LOOK_MS));
      this.#timers.push(setInterval(() => (this.guidance.look(), this.#draw()), GUIDANCE_MS));
      document.addEventListener("keydown", this.#keys);
    }
    this.#look();
    this.#draw();
  }

  close() {
    this.#timers.forEach(clearInterval);
    this.#timers = [];
    document.removeEventListener("keydown", this.#keys);
    this.#unfollow();
  }

  hear(message) {
    if (message.rig !== this.rig) return;
    if (message.op === "status") this.guidance.setScreen(message.status.screen_mm);
    if (message.op === "guidance") this.guidance.take(message.guidance);
    if (message.op === "lost") this.guidance.lose();
  }

  #unfollow() {
    this.#following?.end();
    this.#following = null;
  }

  /** Whatever was begun on this rig last is what is shown. */
  async #look() {
    const { rig } = this;
    if (rig === null || this.page.link.state !== "open") return;
    if (this.#following !== null && this.job !== null && active(this.job)) return;
    const query = `/experiments?rig=${encodeURIComponent(rig)}&limit=1`;
    const found = await this.outcome.of(request("GET", query), "Nothing is known");
    if (found === null || rig !== this.rig || this.#timers.length === 0) return;
    const [job = null] = found.experiments;
    const running = job !== null && active(job);
    if (running && this.#following !== null && this.job !== null && active(this.job)) return;
    this.#unfollow();
    this.#stands(job);
    if (!running) return;
    this.followed = job.id;
    this.#following = new Following(job.id, {
      stands: (now) => this.#stands(now),
      broke: () => this.#draw(),
    });
  }

  #stands(job) {
    this.job = job;
    this.outcome.clear();
    this.#draw();
  }

  #draw() {
    const { page, job } = this;
    const connected = page.link.state === "open" && !page.link.quiet;
    const mine = job !== null && (active(job) || job.id === this.followed) ? job : null;
    // What the address names may be no rig at all.
    const here = !page.gone;
    const screen = screenOf(mine, { connected, here, may: page.can("render") });
    const guided = !this.guidance.root.hidden;
    this.asked.hidden = guided;
    const offered = document.fullscreenEnabled && document.fullscreenElement === null;
    this.full.hidden = !offered || screen.kind === "interval";
    this.progress.hidden = screen.share === null || guided;
    if (screen.share !== null) this.progress.value = screen.share;
    this.asked.dataset.kind = screen.kind;
    say(this.title, screen.title);
    say(this.text, screen.text);
    const question = questionOf(job);
    const same = question === this.question;
    if (!same) this.answered = false;
    const before = this.shown;
    Object.assign(this, { shown: screen, question });
    this.asked.dataset.question = question;
    if (same && JSON.stringify(before) === JSON.stringify(screen)) return;
    const buttons = screen.buttons.map(({ answer, label, keys }) => {
      const made = button(label, () => this.#answer(answer));
      made.setAttribute("aria-keyshortcuts", keys.join(" "));
      return made;
    });
    this.answers.replaceChildren(...(screen.number === null ? buttons : [this.#asksNumber()]));
    this.answers.querySelector("input")?.focus();
  }

  #asksNumber() {
    const { low, high } = this.shown.number;
    const input = element("input", { type: "number", step: "any", min: low, max: high, required: "" });
    input.setAttribute("aria-label", "Your number");
    const form = element("form", {}, input, element("button", { type: "submit" }, "Done"));
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.#answer(input.value);
    });
    return form;
  }

  #press(event) {
    if (event.repeat || event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.target instanceof HTMLInputElement) return;
    // A button that has the focus and takes the key is pressed by it.
    if (event.key === "Enter" && event.target instanceof HTMLButtonElement) return;
    const answer = answerOf(this.shown.buttons, event.key);
    if (answer === null) return;
    event.preventDefault();
    this.#answer(answer);
  }

  async #answer(answer) {
    const { question } = this;
    if (this.answered) return;
    this.answered = true;
    const done = await this.outcome.of(send(this.job, answer), "Not taken");
    if (done === null && question === this.question) this.answered = false; // it may be tried again
  }
}

/** What tells one question from all others; empty where nothing is asked. */
function questionOf(job) {
  return job?.screen == null ? "" : [job.id, job.screen.trial, job.screen.step].join(" ");
}
