/** Arm, disarm, reset: the lease lives as long as this page's connection. */

import { outcomeUnknown, request } from "../connection/api.js";
import { at, say } from "../elements/element.js";

/** For so long after a reset the rig's status tells what came of it. */
const CHECK_MS = 10_000;

/** What came of it is in the rig's state; only what failed, or is not known, is said here. */
export class Arming {
  /** @param {import("../connection/link.js").Link} link */
  constructor(link) {
    this.link = link;
    this.rig = null;
    this.state = null;
    this.mine = false;
    /** The rig whose lease the connection holds; the rig's status may be ahead of it, or behind. */
    this.heldRig = null;
    /** Whether it was asked to arm, and has not answered: a slow rig takes seconds. */
    this.asked = false;
    /** When a reset was sent that the rig's status does not show yet, ms; null: none was. */
    this.resetMs = null;
    // A double click is one; what follows it only ever disarms.
    at("arm").addEventListener("click", ({ detail }) => {
      if (detail < 2 || (detail > 2 && this.mine)) this.#toggle();
    });
    at("reset").addEventListener("click", () => this.#reset());
  }

  /** Take a message of the service. */
  hear(message) {
    if (message.op === "armed") this.heldRig = message.rig;
    if (message.op === "disarmed") this.heldRig = null;
    if (message.op === "armed" || message.what === "arm") this.asked = false;
    if (message.op !== "refused" || !["arm", "disarm"].includes(message.what)) return;
    const unknown = message.code === "outcome_unknown";
    this.#tell(`${unknown ? "Unknown; the rig's state tells" : "Refused"}: ${message.message}`);
  }

  /** Forget the lease: with the connection it has ended. */
  drop() {
    this.heldRig = null;
    this.asked = false;
  }

  /**
   * @param {string} rig
   * @param {object} status the rig's newest
   * @param {boolean} mine whether this page holds it
   */
  show(rig, status, mine) {
    const { state } = status;
    if (rig !== this.rig) this.resetMs = null;
    // A refusal is news of the state that it was met in.
    if (rig !== this.rig || state !== this.state) this.#tell("");
    Object.assign(this, { rig, state, mine });
    const tripped = state === "tripped";
    if (this.resetMs !== null && (!tripped || performance.now() - this.resetMs > CHECK_MS)) {
      this.resetMs = null;
      this.#tell(tripped ? "It is tripped still: reset it again" : "The rig is reset");
    }
  }

  #toggle() {
    const { rig } = this;
    const others = at("share-with");
    if (!this.mine && !others.checkValidity()) {
      at("sharing").open = true; // what is wrong is to be seen
      others.reportValidity();
      return;
    }
    const share_with = others.value.split(/[,; ]+/).filter(Boolean);
    const message = this.mine ? { op: "disarm", rig } : { op: "arm", rig, share_with };
    const sent = this.link.send(message);
    this.asked = sent && !this.mine;
    this.#tell(sent ? "" : `No connection: cannot ${message.op}`);
  }

  async #reset() {
    this.resetMs = performance.now();
    try {
      await request("POST", `/rigs/${encodeURIComponent(this.rig)}/reset`);
    } catch (error) {
      const unknown = outcomeUnknown(error);
      if (unknown && this.resetMs === null) return; // the status has told meanwhile
      if (!unknown) this.resetMs = null;
      const checking = "Unknown whether the rig is reset, checking…";
      this.#tell(unknown ? checking : `Not reset: ${error.message}`);
    }
  }

  #tell(text) {
    say(at("arm-outcome"), text);
  }
}
