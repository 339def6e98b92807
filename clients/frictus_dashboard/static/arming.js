/** Arm, disarm, reset: the lease lives as long as this page's connection. */

import { request } from "./api.js";
import { at, say } from "./element.js";

export class Arming {
  /** @param {import("./link.js").Link} link */
  constructor(link) {
    this.link = link;
    this.rig = null;
    this.heldRig = null;
    at("arm").addEventListener("click", () => this.#toggle());
    at("reset").addEventListener("click", () => this.#reset());
  }

  /** Whether this page holds the rig that it shows. */
  get held() {
    return this.heldRig !== null && this.heldRig === this.rig;
  }

  /** Take a message of the service. */
  hear(message) {
    const outcome = at("arm-outcome");
    if (message.op === "armed") {
      this.heldRig = message.rig;
      say(outcome, "Armed by this page, while it stays open");
    } else if (message.op === "disarmed") {
      this.heldRig = null;
      say(outcome, message.reason ? `Disarmed: ${message.reason}` : "Disarmed");
    } else if (message.op === "refused" && ["arm", "disarm"].includes(message.what)) {
      say(outcome, `Refused: ${message.message}`);
    }
    this.#label();
  }

  /** Forget the lease: with the connection it has ended. */
  drop() {
    this.heldRig = null;
    this.#label();
  }

  /** @param {string} rig @param {object} status @param {string[]} scopes */
  show(rig, status, scopes) {
    if (rig !== this.rig) say(at("arm-outcome"), "");
    this.rig = rig;
    this.#label();
    const tripped = status.state === "tripped";
    const free = this.held || status.owner === null;
    at("arm").hidden = !scopes.includes("render") || tripped || !free;
    at("reset").hidden = !scopes.includes("admin") || !tripped;
  }

  #label() {
    say(at("arm"), this.held ? "Disarm" : "Arm");
  }

  #toggle() {
    const op = this.held ? "disarm" : "arm";
    if (!this.link.send({ op, rig: this.rig })) {
      say(at("arm-outcome"), `No connection: cannot ${op}`);
    }
  }

  async #reset() {
    try {
      const { state } = await request("POST", `/rigs/${encodeURIComponent(this.rig)}/reset`);
      say(at("arm-outcome"), `The rig answered the reset: ${state}`);
    } catch (error) {
      say(at("arm-outcome"), `Not reset: ${error.message}`);
    }
  }
}
