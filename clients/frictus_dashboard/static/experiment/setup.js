/** What a new experiment is asked to do: a form, and the request that it makes. */

import { address } from "../address.js";
import { request } from "../connection/api.js";
import { element, say } from "../elements/element.js";
import { apply, choice, labelled, number, optionsOf } from "../elements/fields.js";
import { heldAlready } from "../rig/holder.js";
import { Outcome } from "../elements/outcome.js";

/** The choice that stands for a file; no protocol has this name. */
const FILE = "";

export class Setup {
  /** @param {(job: object) => void} started */
  constructor(started) {
    this.started = started;
    this.rig = null;
    /** Who holds it; null: nobody, as far as is known. */
    this.owner = null;
    /** Whether a start is on its way: another would be refused, and that told of the first. */
    this.starting = false;
    this.ready = [];
    this.protocol = choice([]);
    this.file = element("input", { type: "file", accept: ".toml", required: "" });
    this.fileLabel = labelled("TOML file", this.file);
    this.participant = element("input", {
      required: "",
      maxlength: "64",
      pattern: "[A-Za-z0-9]+",
      title: "A pseudonym: letters and digits",
      autocomplete: "off",
    });
    this.order = number({ min: 0, max: 1_000_000, step: 1 });
    this.order.value = "0";
    this.order.title = "Number of the participant: blocks of conditions are ordered by it";
    this.about = element("p", { class: "quiet" });
    this.begin = element("button", { type: "submit" }, "Arm the rig and start");
    const opened = { target: "_blank", rel: "noopener" };
    this.answering = element("a", opened, "a page of their own (new tab)");
    this.holder = element("p", { class: "quiet" });
    this.outcome = new Outcome();
    this.root = this.#form();
    this.protocol.addEventListener("change", () => this.#choose());
  }

  /** @param {object[]} ready protocols that come with the service */
  offer(ready) {
    const names = ready.map(({ name }) => name).join();
    if (names === this.ready.map(({ name }) => name).join()) return;
    this.ready = ready;
    const options = ready.map(({ name }) => [name, name]);
    this.protocol.replaceChildren(...optionsOf([...options, [FILE, "A TOML file of yours"]]));
    this.#choose();
  }

  /**
   * An experiment arms the rig by itself, so nobody may hold it.
   *
   * @param {string|null} rig @param {string|null} owner who holds it
   * @param {string} client name of this page to the rigs
   */
  show(rig, owner, client) {
    if (rig !== this.rig) this.outcome.clear();
    Object.assign(this, { rig, owner });
    this.answering.href = address("participant", rig);
    this.#enable();
    say(this.holder, heldAlready(rig, owner, client));
  }

  #enable() {
    this.begin.disabled = this.starting || this.owner !== null;
  }

  #form() {
    const fields = [
      labelled("Protocol", this.protocol),
      this.fileLabel,
      labelled("Participant", this.participant),
      labelled("Order", this.order),
    ];
    const form = element(
      "form",
      { class: "setup" },
      element("div", { class: "fields" }, ...fields),
      this.about,
      element(
        "p",
        {},
        this.begin,
        " This puts voltage on the screen, until the last trial or a stop. The participant begins, on ",
        this.answering,
        ".",
      ),
      this.holder,
      this.outcome.root,
    );
    form.addEventListener("submit", (event) => (event.preventDefault(), this.#start()));
    return form;
  }

  #choose() {
    const chosen = this.ready.find(({ name }) => name === this.protocol.value);
    apply(this.fileLabel, chosen === undefined);
    if (chosen === undefined) {
      say(this.about, "A file as frictus experiment takes it.");
      return;
    }
    const { description, planned, task } = chosen;
    const trials = planned === null ? "" : ` ${planned} trials count.`;
    say(this.about, `${description}${trials} It asks: “${task.question}”`);
  }

  async #start() {
    this.outcome.clear();
    this.starting = true;
    this.#enable();
    const made = await this.outcome.of(this.#send(), "Not started");
    this.starting = false;
    this.#enable();
    if (made !== null) this.started(made);
  }

  async #send() {
    const own = this.protocol.value === FILE;
    const what = own ? { toml: await this.file.files[0].text() } : { protocol: this.protocol.value };
    const who = { participant: this.participant.value, order_row: this.order.valueAsNumber };
    return request("POST", "/experiments", { json: { rig: this.rig, ...who, ...what } });
  }
}
