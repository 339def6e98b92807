/** What has happened at the shown rig while the page is open: each with when and who. Pure. */

import { POLICIES, policyOf } from "./adaptation.js";
import { remark } from "./compensation.js";
import { nameOf } from "./holder.js";
import { LOSSES } from "./loop_losses.js";
import { faultName } from "./strip_state.js";

/** More are forgotten, the oldest first. */
export const MOST = 300;
const MINUTE_NS = 60e9;
const STARTED = "The rig was started again, disarmed; it needs no reset";

export class EventLog {
  constructor() {
    this.clear();
  }

  /** Forget everything: another rig is shown. */
  clear() {
    /** The newest first: {ns, what, who, kind, more}; `who` is empty where the rig does not say. */
    this.entries = [];
    this.version = 0;
  }

  /** Note what a status changes against the one before. */
  takeStatus(before, after, losses, client) {
    if (before === null) return; // what was before the page came is no event
    const ns = after.utc_ns;
    const note = (what, who = "", kind = "", more = "", atNs = ns) => {
      this.#note({ ns: atNs, what, who, kind, more });
    };
    this.#takeLease(before, after, client, note);
    if (after.run !== before.run) note(STARTED, "", "bad");
    this.#takeChoices(before, after, client, note);
    for (const { name, grown } of losses) this.#takeLoss(name, grown, ns);
  }

  /** Note a loss; of a run of losses each counter has one entry a minute. */
  #takeLoss(name, grown, ns) {
    const others = this.entries.findIndex(({ loss }) => loss === undefined);
    const run = others < 0 ? this.entries : this.entries.slice(0, others);
    const kept = run.find(({ loss }) => loss === name);
    if (kept === undefined || ns - kept.ns > MINUTE_NS) {
      const what = `Losses, ${LOSSES[name]}: ${grown}`;
      this.#note({ ns, what, who: "", kind: "warn", more: "", loss: name, grown });
      return;
    }
    kept.grown += grown;
    kept.more = ` within ${Math.ceil((ns - kept.ns) / 1e9)} s`;
    kept.what = `Losses, ${LOSSES[name]}: ${kept.grown}`;
    this.version += 1;
  }

  #takeLease(before, after, client, note) {
    const { last_end: end, fault } = after;
    const again = after.run !== before.run;
    if (end !== null && end.utc_ns !== before.last_end?.utc_ns) {
      const held = end.by === end.owner ? "" : `, held by ${nameOf(end.owner, client)}`;
      const by = end.by === null ? "" : nameOf(end.by, client);
      const what = { stopped: "Stopped", disarmed: "Disarmed" }[end.reason];
      note(what ?? `Disarmed: ${end.reason}`, by, "", held, end.utc_ns);
    } else if (before.state === "tripped" && after.state === "disarmed" && !again) {
      note("Reset");
    } else if (before.state !== "disarmed" && after.state === "disarmed" && !again) {
      note("Disarmed");
    }
    if (fault !== null && fault.utc_ns !== before.fault?.utc_ns) {
      note(`Tripped: ${faultName(fault.kind)}, ${fault.reason}`, "", "bad", "", fault.utc_ns);
    }
    if (after.owner !== null && after.owner !== before.owner) {
      note("Armed", nameOf(after.owner, client), "armed");
    }
  }

  /** What the rig does not say who chose is the holder's where nobody else may choose. */
  #takeChoices(before, after, client, note) {
    const alone = after.owner !== null && after.share_with.length === 0;
    const holder = alone ? nameOf(after.owner, client) : "";
    const [was, now] = [before, after].map(({ compensation }) => remark(compensation));
    if (was !== now) note(now === "" ? "Compensation: by the model" : now, holder);
    if (policyOf(before) !== policyOf(after)) {
      note(`Policy: ${POLICIES[policyOf(after)].title}`);
    }
    const [changed, changes] = [before, after].map(({ adaptations = 0 }) => adaptations);
    const another = before.model_etag !== after.model_etag;
    if (changes > changed) note("Model adapted to the finger", "the tracker");
    else if (changes < changed && another) note("Model put back, or set anew");
    else if (another) note("Model set");
  }

  /** Note another scene. @param {object|null} status the rig's newest */
  takeScene(before, after, status, client) {
    if (before === null || before.etag === after.etag) return;
    const ns = after.utc_ns ?? status?.utc_ns ?? 0;
    const alone = status !== null && status.owner !== null && status.share_with.length === 0;
    const name = after.scene.name || "without a name";
    const sources = { stream: "Texture streamed by a client", excitation: "Excitation played" };
    const what = sources[after.source] ?? `Scene ${name}`;
    this.#note({ ns, what, who: alone ? nameOf(status.owner, client) : "", kind: "" });
  }

  /** Note that a recording begins or ends. */
  takeRecording(before, after) {
    if (before === null || before.recording === after.recording) return;
    const { utc_ns: ns, name, lost_blocks: lost, problem } = after;
    if (after.recording) {
      this.#note({ ns, what: `Recording ${name} begins`, who: "", kind: "" });
      return;
    }
    const why = problem === null ? "" : `: ${problem}`;
    const kind = problem !== null || lost > 0 ? "warn" : "";
    const losses = lost === 0 ? "nothing lost" : `blocks lost: ${lost}`;
    this.#note({ ns, what: `Recording ${name} ends, ${losses}${why}`, who: "", kind });
  }

  #note(entry) {
    this.entries.unshift(entry);
    this.entries.length = Math.min(this.entries.length, MOST);
    this.version += 1;
  }
}
