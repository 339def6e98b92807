/** What the tracker may do with the model: a switch, and the way back. Pressed is in force. */

import { POLICIES } from "../rig/adaptation.js";
import { request } from "../connection/api.js";
import { element, say } from "../elements/element.js";
import { Outcome } from "../elements/outcome.js";
import { coded } from "../elements/coded.js";
import { times } from "./units.js";

export class Policy {
  /** @param {import("../views.js").Page} page */
  constructor(page) {
    this.page = page;
    this.rig = null;
    this.policy = "observe";
    this.adaptations = 0;
    /** A policy that was asked for and that the status does not say yet. */
    this.asked = null;
    this.outcome = new Outcome();
    this.why = element("p", { id: "policy-why", class: "quiet" });
    this.heldBack = element("p", { class: "held-back" });
    this.proposal = element("p", { class: "proposal" });
    this.buttons = Object.entries(POLICIES).map(([value, { title }]) => {
      const button = element("button", { type: "button", value }, title);
      button.setAttribute("aria-describedby", `policy-${value} policy-why`);
      button.addEventListener("click", () => this.#choose(value));
      return button;
    });
    const rows = this.buttons.map((button) => {
      const { does } = POLICIES[button.value];
      return element("li", {}, button, element("span", { id: `policy-${button.value}` }, does));
    });
    const group = element("ul", { class: "policies" }, ...rows);
    const switched = element("div", { role: "group", "aria-label": "Policy" }, group);
    this.undo = element("button", { type: "button" }, "Put the model back");
    this.undo.setAttribute("aria-describedby", "policy-count policy-why");
    this.undo.addEventListener("click", () => this.#putBack());
    this.count = element("span", { id: "policy-count" });
    const back = element("p", { class: "back" }, this.undo, this.count);
    this.root = element("div", {}, switched, this.why, this.heldBack);
    this.root.append(this.proposal, back, this.outcome.root);
  }

  /** @param {object} state of `viewStateOf` */
  show({ rig, policy, adaptations, heldBack = "", proposal = "" }) {
    if (rig !== this.rig) {
      this.asked = null;
      this.outcome.clear();
    }
    if (this.asked?.(policy, adaptations)) {
      this.asked = null;
      this.outcome.clear();
    }
    Object.assign(this, { rig, policy, adaptations });
    const why = this.#keptFrom();
    say(this.why, why);
    this.why.hidden = why === "";
    for (const button of this.buttons) {
      button.setAttribute("aria-pressed", String(button.value === policy));
      button.disabled = why !== "";
    }
    this.undo.disabled = why !== "" || adaptations === 0;
    const changed = `Changed ${times(adaptations)} since it was set`;
    say(this.count, adaptations === 0 ? "The model is as it was set" : changed);
    this.heldBack.replaceChildren(...coded(`The model stays as it is: ${heldBack}.`));
    this.heldBack.hidden = heldBack === "";
    say(this.proposal, proposal);
    this.proposal.hidden = proposal === "";
  }

  /** Why this page may not choose, in words; empty where it may. */
  #keptFrom() {
    if (this.rig === null || !this.page.live.trusted) return "The rig cannot be reached now.";
    if (this.page.can("calibrate")) return "";
    return "Choosing needs the scope calibrate, which your token does not have.";
  }

  #choose(policy) {
    const title = POLICIES[policy].title;
    this.#ask({ policy, undo: false }, title, (now) => now === policy);
  }

  /** Back to the model that was set; adapting ends, or it would be changed again at once. */
  #putBack() {
    const policy = this.policy === "adapt" ? "suggest" : this.policy;
    const back = (now, count) => now === policy && count === 0;
    this.#ask({ policy, undo: true }, "The model put back", back);
  }

  async #ask(json, what, done) {
    const { rig } = this;
    this.asked = done;
    this.outcome.unknown(`${what}: asked, waiting for the rig to say so…`);
    const path = `/rigs/${encodeURIComponent(rig)}/adaptation`;
    const asked = request("PUT", path, { json }).then(() => true);
    const told = ({ status }) => done(status?.adaptation, status?.adaptations) || null;
    const wanted = () => rig === this.rig && this.asked === done;
    const settled = this.page.settled(asked, this.outcome, rig, told);
    const answered = await this.outcome.of(settled, "Not changed", wanted);
    if (answered === null && wanted()) this.asked = null;
  }
}
