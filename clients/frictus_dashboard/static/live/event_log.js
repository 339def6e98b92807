/** What has happened at the shown rig while the page is open: each with when and who. Pure. */

import { clock } from "../elements/figures.js";
import { POLICIES, policyOf } from "../rig/adaptation.js";
import { modeTitle } from "../rig/compensation.js";
import { isJob, nameOf } from "../rig/holder.js";
import { LOSSES } from "../rig/loop_losses.js";
import { faultName, stopOfNobody } from "../strip/strip_state.js";

/** More are forgotten, the oldest first. */
export const MOST = 300;
const MINUTE_NS = 60e9;
const SCENE_CALLS = ["scene", "excite", "open_stream", "close_stream"];
const STARTED = "The rig was started again, disarmed; it needs no reset";

export class EventLog {
  constructor() {
    this.clear();
  }

  /** Forget everything: another rig is shown. */
  clear() {
    /** The newest first: {ns, what, who, kind, more}; `who` is empty where the rig does not say. */
    this.entries = [];
    /** The calibration or experiment that held the rig last, or null. */
    this.job = null;
    this.version = 0;
  }

  /**
   * Note what a status changes against the one before.
   *
   * @param {object|null} before @param {object} after
   * @param {object[]} losses of it @param {string} client name of this page
   * @param {object|null} scene the newest
   */
  takeStatus(before, after, losses, client, scene) {
    if (before === null) return; // what was before the page came is no event
    const ns = after.utc_ns;
    if (after.owner !== null) this.job = isJob(after.owner) ? after.owner : null;
    const { job } = this;
    const note = (what, who = "", kind = "", more = "", atNs = ns) => {
      // What nobody else is named for is the job's own, also right after its lease; no trip is.
      const own = kind !== "bad" && ["", nameOf(job, client)].includes(who);
      return this.#note({ ns: atNs, what, who, kind, more, job: own ? job : null });
    };
    const by = (...calls) => callerOf(calls, before, after, client);
    this.#takeLease(before, after, client, by, note);
    if (after.run !== before.run) note(STARTED, "", "bad");
    this.#takeChoices(before, after, scene, by, note);
    this.#fold();
    for (const { name, grown } of losses) this.#takeLoss(name, grown, ns);
  }

  /** Of a calibration or experiment the same is told once, and how often: it arms for each trial. */
  #fold() {
    const [{ job = null } = {}] = this.entries;
    if (job === null) return;
    const run = this.#newest((one) => one.job === job || one.loss !== undefined);
    for (const one of run.filter((each) => each.job === job)) {
      const first = run.findLast(({ what, who }) => what === one.what && who === one.who);
      if (first === one) continue;
      first.times = (first.times ?? 1) + (one.times ?? 1);
      first.lastNs = Math.max(first.lastNs ?? first.ns, one.lastNs ?? one.ns);
      first.more = `, ${first.times} times until ${clock(first.lastNs, first.ns)}`;
      this.entries.splice(this.entries.indexOf(one), 1);
      this.version += 1;
    }
  }

  /** The newest entries, up to the first of which something does not hold. */
  #newest(holds) {
    const end = this.entries.findIndex((one) => !holds(one));
    return this.entries.slice(0, end < 0 ? undefined : end);
  }

  /** Note a loss; of a run of losses each counter has one entry a minute. */
  #takeLoss(name, grown, ns) {
    const kept = this.#newest(({ loss }) => loss !== undefined).find(({ loss }) => loss === name);
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

  #takeLease(before, after, client, by, note) {
    const { last_end: end, fault } = after;
    const again = after.run !== before.run;
    if (end !== null && end.utc_ns !== before.last_end?.utc_ns) {
      const held = end.by === end.owner ? "" : `, held by ${nameOf(end.owner, client)}`;
      const ender = end.by === null ? "" : nameOf(end.by, client);
      const what = { stopped: "Stopped", disarmed: "Disarmed" }[end.reason];
      note(what ?? `Disarmed: ${end.reason}`, ender, "", held, end.utc_ns);
    } else if (before.state === "tripped" && after.state === "disarmed" && !again) {
      note("Reset", by("reset"));
    } else if (before.state === "armed" && after.state === "disarmed" && !again) {
      note("Disarmed"); // what stopped it was told as its ramp began
    }
    const stop = stopOfNobody(after);
    if (stop !== null && by("stop") !== "") {
      note("Stopped", by("stop"), "", ", nobody held it", stop.utc_ns);
    }
    if (fault !== null && fault.utc_ns !== before.fault?.utc_ns) {
      note(`Tripped: ${faultName(fault.kind)}, ${fault.reason}`, "", "bad", "", fault.utc_ns);
    }
    if (after.owner !== null && after.owner !== before.owner) {
      note("Armed", nameOf(after.owner, client), "armed");
    }
  }

  #takeChoices(before, after, scene, by, note) {
    const [was, now] = [before, after].map(({ compensation }) => modeTitle(compensation));
    if (was !== now) note(`Compensation set to ${now}`, by("compensation"));
    if (policyOf(before) !== policyOf(after)) {
      note(`Policy: ${POLICIES[policyOf(after)].title}`, by("adaptation"));
    }
    const [changed, changes] = [before, after].map(({ adaptations = 0 }) => adaptations);
    const another = before.model_etag !== after.model_etag;
    if (changes > changed) note("Model adapted to the finger", "the tracker");
    else if (changes < changed && another) note("Model put back, or set anew", by("model"));
    else if (another) note("Model set", by("model"));
    const { scene_etag: etag } = after;
    if (before.scene_etag !== etag) {
      note("Another scene", by(...SCENE_CALLS)).etag = etag;
      if (scene !== null) this.takeScene(scene);
    }
  }

  /** Say what a scene is where it was told by its etag only: it may come after the status. */
  takeScene(scene) {
    const entry = this.entries.find(({ etag }) => etag === scene.etag);
    if (entry === undefined) return;
    const sources = { stream: "Texture streamed by a client", excitation: "Excitation played" };
    entry.what = sources[scene.source] ?? sceneIn(scene.scene);
    this.version += 1;
    this.#fold();
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
    return entry;
  }
}

/** A scene of no region has no name that says what it is. */
function sceneIn({ name, regions }) {
  return regions.length === 0 ? "A smooth screen" : `Scene ${name || "without a name"}`;
}

/** Who last had one of these calls accepted between two statuses; empty: nobody. */
function callerOf(calls, before, after, client) {
  const made = calls
    .map((name) => after.last_calls?.[name])
    .filter((call) => call !== undefined && call.utc_ns > before.utc_ns)
    .toSorted((one, other) => other.utc_ns - one.utc_ns);
  return made.length === 0 ? "" : nameOf(made[0].client, client);
}
