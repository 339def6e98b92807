/** Arm, disarm, reset: the lease lives as long as this page's connection. */

import { outcomeUnknown, request } from "./api.js";
import { at, say } from "./element.js";

/** For so long after a reset that was not answered its status tells what came of it. */
const CHECK_MS = 10_000;

export class Arming {
  /** @param {import("./link.js").Link} link */
  constructor(link) {
    this.link = link;
    this.rig = null;
    this.heldRig = null;
    /** When a reset was sent whose outcome is unknown, ms; null: none was. */
    this.resetMs = null;
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
      const unknown = message.code === "outcome_unknown";
      say(outcome, `${unknown ? "Unknown; the rig's state tells" : "Refused"}: ${message.message}`);
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
    if (rig !== this.rig) {
      say(at("arm-outcome"), "");
      this.resetMs = null;
    }
    this.rig = rig;
    this.#label();
    const tripped = status.state === "tripped";
    if (this.resetMs !== null && (!tripped || performance.now() - this.resetMs > CHECK_MS)) {
      this.resetMs = null;
      const told = tripped ? "It is tripped still: reset it again" : "The rig is reset";
      say(at("arm-outcome"), told);
    }
    const free = this.held || status.owner === null;
    at("arm").hidden = !scopes.includes("render") || tripped;
    at("arm").disabled = !free;
    at("sharing").hidden = at("arm").hidden || status.owner !== null;
    at("reset").hidden = !scopes.includes("admin") || !tripped;
  }

  #label() {
    say(at("arm"), this.held ? "Disarm" : "Arm");
  }

  #toggle() {
    const { rig } = this;
    const others = at("share-with");
    if (!this.held && !others.reportValidity()) return;
    const share_with = others.value.split(/[,; ]+/).filter(Boolean);
    const message = this.held ? { op: "disarm", rig } : { op: "arm", rig, share_with };
    if (!this.link.send(message)) {
      say(at("arm-outcome"), `No connection: cannot ${message.op}`);
    }
  }

  async #reset() {
    try {
      const { state } = await request("POST", `/rigs/${encodeURIComponent(this.rig)}/reset`);
      say(at("arm-outcome"), `The rig answered the reset: ${state}`);
    } catch (error) {
      const unknown = outcomeUnknown(error);
      if (unknown) this.resetMs = performance.now();
      const checking = "Unknown whether the rig is reset, checking…";
      say(at("arm-outcome"), unknown ? checking : `Not reset: ${error.message}`);
    }
  }
}
