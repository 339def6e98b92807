/** Horizontal bars against a line: evidence by cause, and the error of each model. */

import { element, say } from "../elements/element.js";
import { decibels, nats } from "./units.js";

/** One bar: a name, a length, a value in words. */
function bar(title, share, text, look) {
  const filled = element("div", { class: "filled" });
  filled.style.setProperty("--share", `${(100 * share).toFixed(1)}%`);
  const track = element("div", { class: "track", "aria-hidden": "true" }, filled);
  const row = element("li", {}, element("span", {}, title), track, element("b", {}, text));
  row.dataset.look = look;
  return row;
}

/** One cause, with what `evidenceOf` says of it. */
function causeRow({ cause, title, share, nats: value, alarmed, shared, beyond, where }) {
  const look = alarmed ? "alarm" : shared ? "warn" : "quiet";
  const row = bar(title, share, `${nats(value)}${beyond ? " ▸" : ""}`, look);
  row.dataset.cause = cause;
  if (alarmed) row.firstChild.append(element("em", {}, "alarm"));
  if (where !== "" && !alarmed) row.append(element("small", {}, where));
  return row;
}

/** Evidence against the model in force, towards the line at which it is an alarm. */
export class Evidence {
  constructor() {
    this.bars = element("ul", { class: "bars", "aria-label": "Evidence by cause" });
    this.note = element("p", { class: "quiet" });
    this.root = element("div", {}, this.bars, this.note);
  }

  /** @param {object} state of `viewStateOf` */
  show({ evidence }) {
    if (evidence === undefined) {
      this.bars.replaceChildren();
      say(this.note, "");
      return;
    }
    const { rows, others, quiet, alarmNats, alarmShare } = evidence;
    this.bars.style.setProperty("--line", `${(100 * alarmShare).toFixed(1)}%`);
    this.bars.replaceChildren(...rows.map(causeRow));
    this.bars.hidden = rows.length === 0;
    const [one, many] = quiet ? ["is quiet", "are quiet"] : ["has less", "have less"];
    const left = others === 1 ? `1 other ${one}` : `${others} others ${many}`;
    const all = others === 0 ? "No cause is watched yet" : "Nothing speaks against it";
    const shared = rows.some((row) => row.shared)
      ? " Beyond it without an alarm: another cause explains it better."
      : "";
    say(this.note, `${rows.length === 0 ? all : left}. The line is the alarm, ` +
      `${nats(alarmNats)}: a right model reaches it in at most 1 % of sessions.${shared}`);
  }
}

/** The error of a rendering by each model, against what a finger can tell. */
export class Errors {
  constructor() {
    this.bars = element("ul", { class: "bars", "aria-label": "Error of rendering by model" });
    this.note = element("p", { class: "quiet" });
    this.root = element("div", {}, this.bars, this.note);
  }

  /** @param {object} state of `viewStateOf` */
  show({ errors, jndDb, estimate }) {
    if (errors === undefined) {
      this.bars.replaceChildren();
      say(this.note, "");
      return;
    }
    const full = Math.max(1.6 * jndDb, 1.1 * Math.max(...errors.map(({ db }) => db ?? 0)));
    this.bars.style.setProperty("--line", `${((100 * jndDb) / full).toFixed(1)}%`);
    const made = errors.map(({ name, title, db }) => {
      const look = db === null ? "none" : db > jndDb ? "warn" : "good";
      const row = bar(title, (db ?? 0) / full, db === null ? "–" : decibels(db), look);
      row.dataset.model = name;
      return row;
    });
    this.bars.replaceChildren(...made);
    const { in_force: inForce, newest } = estimate.gain_nats;
    const signed = (value) => `${value < 0 ? "−" : "+"}${nats(Math.abs(value))}`;
    const gained = [
      ...(inForce === undefined ? [] : [`${signed(inForce)} by the model in force`]),
      ...(newest === undefined ? [] : [`${signed(newest)} by what is learned`]),
    ];
    const gain = `Log-likelihood gained over the first model: ${gained.join(", ")}.`;
    const line = `The line is what a finger can just tell, ${decibels(jndDb)}.`;
    say(this.note, gained.length === 0 ? line : `${line} ${gain}`);
  }
}
