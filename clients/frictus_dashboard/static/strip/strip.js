/** The strip on every view: draws what `stripStateOf` says, and nothing of its own. */

import { at, element, say } from "../elements/element.js";
import { Gauge } from "./gauge.js";
import { FORCE, SPEED } from "./strip_state.js";

export class Strip {
  constructor() {
    this.speed = new Gauge(at("speed"), SPEED);
    this.force = new Gauge(at("force"), FORCE);
    this.badges = "";
    // Escape stops: what is open closes where a hand or the focus goes elsewhere.
    const close = ({ target }) => {
      for (const open of at("strip").querySelectorAll("details[open]")) {
        if (!open.contains(target)) open.open = false;
      }
    };
    document.addEventListener("pointerdown", close);
    document.addEventListener("focusin", close);
  }

  /** @param {object|null} state of `stripStateOf` */
  show(state) {
    at("strip").hidden = state === null;
    if (state === null) {
      say(at("fault"), "");
      return;
    }
    at("strip").dataset.state = state.kind;
    at("strip").dataset.mine = state.mine;
    say(at("state"), state.title);
    say(at("owner"), state.who);
    at("owner").title = state.known === "" ? "" : `Known to the rig as ${state.known}`;
    say(at("since"), state.then);
    at("since").title = state.then; // it may be cut off
    this.speed.show(state.speed);
    this.force.show(state.force);
    this.#showBadges(state.badges);
    at("loop").dataset.kind = state.loop.kind;
    say(at("loop-text"), `: ${state.loop.text}`);
    say(at("fault"), state.fault);
    at("arm").hidden = state.arm.hidden;
    at("arm").disabled = state.arm.disabled;
    say(at("arm"), state.arm.label);
    at("sharing").hidden = state.sharing.hidden;
    at("reset").hidden = state.reset.hidden;
  }

  #showBadges(badges) {
    const shown = JSON.stringify(badges);
    if (shown === this.badges) return;
    this.badges = shown;
    at("badges").replaceChildren(...badges.map(badge));
    at("notes").hidden = badges.length === 0;
    say(at("notes-count"), `${badges.length} ${badges.length === 1 ? "note" : "notes"}`);
    at("notes-list").replaceChildren(
      ...badges.map(({ word, why }) => element("li", {}, element("b", {}, word), `: ${why}`)),
    );
  }
}

function badge({ name, word, why }) {
  const told = element("span", { class: "unseen" }, `: ${why}`);
  const title = `${word}: ${why}`;
  return element("li", { class: "badge", "data-badge": name, title }, word, told);
}
