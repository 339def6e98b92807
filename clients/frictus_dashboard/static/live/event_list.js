/** The event log as a list, the newest first, behind a button of the strip. */

import { at, element, say } from "../elements/element.js";
import { clock } from "../strip/strip_state.js";

export class EventList {
  /**
   * @param {import("./event_log.js").EventLog} log
   * @param {(ns: number) => void} look shows what was measured then
   */
  constructor(log, look) {
    this.log = log;
    this.look = look;
    this.shown = -1;
    this.of = null;
  }

  /** @param {string|null} rig whose log it is */
  show(rig) {
    if (this.shown === this.log.version && this.of === rig) return;
    this.shown = this.log.version;
    this.of = rig;
    const { entries } = this.log;
    const none = "Nothing yet: events are kept from when this page shows the rig, while it is open.";
    say(at("events-note"), entries.length === 0 ? none : "The newest first");
    at("events-list").replaceChildren(...entries.map((entry) => this.#line(entry)));
  }

  #line({ ns, what, who, kind, more = "" }) {
    const by = who === "" ? [] : [element("span", { class: "by" }, ` by ${who}`)];
    const time = element("time", {}, clock(ns));
    const show = element("button", { type: "button", title: "What was measured then" }, time);
    show.addEventListener("click", () => this.look(ns));
    return element("li", { "data-kind": kind }, show, ` ${what}`, ...by, more);
  }
}
