/** The event log as a list, the newest first, behind a button of the strip. */

import { at, element, say } from "../elements/element.js";
import { clock } from "../elements/figures.js";

export class EventList {
  /**
   * @param {import("./event_log.js").EventLog} log
   * @param {(ns: number) => void} look shows what was measured then
   */
  constructor(log, look) {
    this.log = log;
    this.look = look;
    this.shown = "";
  }

  /** @param {string|null} rig whose log it is @param {number} nowNs that the rig said last */
  show(rig, nowNs) {
    const shown = [rig, this.log.version, new Date(nowNs / 1e6).toDateString()].join();
    if (shown === this.shown) return;
    this.shown = shown;
    const { entries } = this.log;
    const none = "Nothing yet: events are kept from when this page shows the rig, while it is open.";
    say(at("events-note"), entries.length === 0 ? none : "The newest first");
    at("events-list").replaceChildren(...entries.map((entry) => this.#line(entry, nowNs)));
  }

  #line({ ns, what, who, kind, more = "" }, nowNs) {
    const by = who === "" ? [] : [element("span", { class: "by" }, ` by ${who}`)];
    const time = element("time", {}, clock(ns, nowNs));
    const show = element("button", { type: "button", title: "What was measured then" }, time);
    show.addEventListener("click", () => this.look(ns));
    return element("li", { "data-kind": kind }, show, ` ${what}`, ...by, more);
  }
}
