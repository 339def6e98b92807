/** The live view of one rig: takes what the service sends, draws it, tells it in words. */

import { isRigName } from "../address.js";
import { Arming } from "../rig/arming.js";
import { HeldFlags } from "../strip/badges.js";
import { onSchemeChange } from "../canvas/colours.js";
import { Compensation } from "../rig/compensation.js";
import { at, element, say } from "../elements/element.js";
import { EstimateLog } from "./estimate_log.js";
import { EventList } from "./event_list.js";
import { EventLog } from "./event_log.js";
import { decode } from "../connection/frames.js";
import { Health } from "./health.js";
import { keptOut, nameOf, takesRig } from "../rig/holder.js";
import { Listening } from "../listening/view.js";
import { LoopLosses } from "../rig/loop_losses.js";
import { Pointing } from "./pointing.js";
import { Recorder } from "../recordings/recorder.js";
import { Strip } from "../strip/strip.js";
import { stripStateOf } from "../strip/strip_state.js";
import { Surface } from "./surface.js";
import { COLUMN_S, COLUMNS } from "../traces/trace.js";
import { STREAMS, Traces } from "../traces/view.js";

const WORDS_MS = 1_000;
/** A rig tells its status every second: longer without any word, it is silent. */
const SILENT_MS = 1_700;
const CALM = matchMedia("(prefers-reduced-motion: reduce)");
const CALM_MS = 250;
/** All of the strip changes together, no faster than can be read. */
const READ_MS = 250;

export class Live {
  /** @param {import("../connection/link.js").Link} link */
  constructor(link) {
    this.link = link;
    this.surface = new Surface(at("surface"));
    this.losses = new LoopLosses();
    this.strip = new Strip();
    this.recorder = new Recorder(at("record"));
    this.health = new Health();
    this.arming = new Arming(link);
    this.compensation = new Compensation();
    this.estimates = new EstimateLog();
    this.events = new EventLog();
    this.traces = new Traces(at("traces"), this.events, (ns) => this.#deviceS(ns));
    this.eventList = new EventList(this.events, (ns) => this.#lookAt(ns));
    this.pointing = new Pointing(this.surface, (message) => link.send(message), () => {
      // What was felt of another hand is not averaged with this one.
      this.listening.felt.clear();
      this.#showTakeover();
    });
    this.listening = new Listening(at("spectrum"), () => this.state);
    this.drawnMs = this.toldMs = this.stripMs = -Infinity;
    this.trusted = false;
    /** Whether the service, which would see it, does not. */
    this.gone = false;
    this.shown = true;
    this.open(null);
    onSchemeChange(() => {
      for (const each of [this.surface, this.traces, this.listening]) each.redraw();
    });
    requestAnimationFrame((nowMs) => this.#draw(nowMs));
  }

  /** Show a rig; null: none. */
  open(rig) {
    this.rig = rig;
    this.state = { status: null, scene: null, model: null, finger: null, recording: null };
    /** When the recorder said something new last, ms. */
    this.recordingMs = -Infinity;
    /** UTC since when the rig is held by its owner; null: since before this page came. */
    this.heldNs = null;
    /** A sample and when it was taken: the newest finger's. */
    this.timed = { sample: NaN, utc_ns: NaN };
    this.rateHz = NaN;
    this.flags = new HeldFlags();
    this.estimates.clear();
    this.losses.clear();
    this.health.clear();
    this.events.clear();
    this.traces.open(rig);
    this.heardMs = -Infinity;
    this.present = false;
    this.#watch();
    this.listening.open(rig);
    this.#showStrip();
  }

  /** Show the charts, or leave the place to another view; state and gauges stay. */
  reveal(shown) {
    if (shown === this.shown) return;
    this.shown = shown;
    at("live").hidden = !shown;
    this.listening.shown = shown;
    this.#watch();
  }

  #watch() {
    // A name that no rig can have would end the connection.
    const rig = isRigName(this.rig) ? this.rig : null;
    this.link.watch({
      rig,
      streams: rig === null || !this.shown ? [] : STREAMS,
      rate_hz: 60,
      columns: COLUMNS,
      window_s: COLUMNS * COLUMN_S,
      raw: false,
    });
  }

  /** Whether the rig is there and speaks. */
  get alive() {
    return this.present && performance.now() - this.heardMs < SILENT_MS;
  }

  /** The service says, or the broken connection means, that the rig cannot be seen. */
  lose() {
    this.present = false;
    this.state.finger = null;
    this.surface.setFinger(null, 0);
  }

  /** Show what the rig said last as its state, or only as what it said last. */
  trust(trusted, gone) {
    if (trusted === this.trusted && gone === this.gone) return;
    Object.assign(this, { trusted, gone });
    if (this.state.status !== null) this.#showStatus();
    this.#showStrip();
  }

  /** Take a JSON message. */
  hear(message) {
    this.arming.hear(message);
    if (message.rig !== this.rig) return;
    if (message.op === "lost") this.lose();
    if (message.op === "estimate") {
      this.estimates.take(message.estimate, performance.now(), this.state.status?.utc_ns);
    }
    if (!Object.hasOwn(this.state, message.op)) return;
    this.#follow(message.op, this.state[message.op], message[message.op]);
    this.state[message.op] = message[message.op];
    // What a rig last said is kept for late joiners: only a finger or news show that it lives.
    if (message.op === "status" || message.op === "finger") {
      this.heardMs = performance.now();
      this.present = true;
    }
    if (message.op === "status") this.#showStatus();
    if (message.op === "scene") this.#showScene();
    if (message.op === "finger") this.#showFinger();
  }

  /** Take a binary frame. */
  take(buffer) {
    const frame = decode(buffer);
    if (frame.run !== this.state.status?.run) return; // on its way when another rig was chosen
    this.heardMs = performance.now();
    this.rateHz = frame.sampleRateHz;
    this.traces.push(frame);
    this.flags.note(frame.flags, this.heardMs);
  }

  /** Note what a message changes against the one before. */
  #follow(op, before, after) {
    const client = this.link.welcome?.client ?? "";
    const nowMs = performance.now();
    if (op === "status") {
      if (before !== null && takesRig(before, after)) this.heldNs = after.utc_ns;
      const losses = this.losses.take(after, nowMs);
      this.events.takeStatus(before, after, losses, client, this.state.scene);
    }
    if (op === "scene") this.events.takeScene(after);
    if (op === "recording") {
      // What was said before a reconnection is told once more: it has not become younger.
      if (before?.utc_ns !== after.utc_ns) this.recordingMs = nowMs;
      this.events.takeRecording(before, after);
    }
  }

  /** When something was, s since the device's first sample; NaN while that is not known. */
  #deviceS(ns) {
    const { sample, utc_ns: then } = this.timed;
    return sample / this.rateHz + (ns - then) / 1e9;
  }

  /** Show the traces as they were. */
  #lookAt(ns) {
    if (this.rig === null) return;
    location.hash = `#/live/${encodeURIComponent(this.rig)}`;
    this.traces.lookAt(ns);
    at("traces").scrollIntoView();
  }

  #showStatus() {
    const { status } = this.state;
    const { scopes = [], client = "" } = this.link.welcome ?? {};
    this.health.show(status);
    this.surface.setScreen(status.screen_mm);
    this.arming.show(this.rig, status, status.owner === client);
    this.#showStrip();
    const may = this.trusted && scopes.includes("render");
    const model = this.state.model?.model ?? null;
    this.compensation.show(this.rig, status, may, client, model);
    this.#showFingerSource(scopes.includes("render"), client);
  }

  #showFingerSource(may, client) {
    const { status } = this.state;
    const { finger_source: source, finger_takeover: takeover = false, owner } = status;
    const pointer = source === "pointer";
    const owned = ![null, client].includes(owner);
    const theirs = takeover ? keptOut(this.rig, status, client) !== "" : owned;
    this.pointing.enable((pointer || takeover) && !theirs && may);
    this.listening.followed = pointer && this.pointing.enabled;
    const held = `The finger is a pointer's, and ${nameOf(owner, client)} holds the rig.`;
    this.source = pointer && theirs ? held : FINGERS[pointer ? may : source];
    this.#showTakeover();
  }

  /** Invite to take over a finger that strokes by itself, or say that it is taken. */
  #showTakeover() {
    const { pointing, state } = this;
    const { touching } = pointing;
    at("takeover").hidden = !(pointing.enabled && state.status?.finger_takeover);
    at("takeover").toggleAttribute("data-taken", touching);
    say(at("takeover"), touching ? TAKEN : INVITATION);
    say(at("surface-help"), touching ? "" : this.source);
  }

  #showStrip() {
    const nowMs = performance.now();
    this.stripMs = nowMs;
    const { scopes = [], client = "" } = this.link.welcome ?? {};
    const { trusted, gone, heldNs } = this;
    const flags = this.flags.recent(nowMs);
    const losses = this.losses.recent(nowMs);
    const ageMs = nowMs - this.heardMs;
    const { asked, heldRig } = this.arming;
    const settling = asked || (heldRig !== null && this.state.status?.owner !== client);
    const own = { client, scopes, settling };
    const heard = { ...this.state, trusted, gone, ageMs, flags, losses, heldNs, ...own };
    this.strip.show(stripStateOf(heard));
    this.eventList.show(this.rig, this.state.status?.utc_ns);
    if (!this.shown) return;
    const { recording } = this.state;
    const may = scopes.includes("calibrate");
    const sinceMs = nowMs - this.recordingMs;
    this.recorder.show({ rig: this.rig, recording, ageMs: sinceMs, trusted, may });
  }

  #showScene() {
    const { scene, applied, source } = this.state.scene;
    this.surface.setRegions(source === "scene" ? scene.regions : []);
    const gain = `at ${(100 * applied.gain).toFixed(0)} % of the friction asked for`;
    const smooth = scene.regions.length === 0;
    const words = {
      scene: smooth ? "A smooth screen" : `Scene ${scene.name || "without a name"}, ${gain}`,
      stream: `A client streams a texture to the whole screen, ${gain}`,
      excitation: "An excitation is played, as in a calibration",
    };
    say(at("scene-text"), [words[source], ...applied.notes].join("; "));
    const shown = this.surface.regions.map((region, i) => {
      return element("li", {}, `${region.name || `Region ${i + 1}`}: ${region.texture.kind}`);
    });
    at("regions").replaceChildren(...shown);
  }

  #showFinger() {
    this.timed = this.state.finger;
    this.surface.setFinger(this.state.finger, performance.now());
  }

  #draw(nowMs) {
    requestAnimationFrame((later) => this.#draw(later));
    this.pointing.tick(nowMs);
    if (CALM.matches && nowMs - this.drawnMs < CALM_MS) return;
    this.drawnMs = nowMs;
    if (nowMs - this.stripMs >= READ_MS) this.#showStrip();
    if (this.shown) {
      this.surface.draw(nowMs);
      this.traces.draw(nowMs);
      this.listening.draw();
    }
    if (nowMs - this.toldMs < WORDS_MS) return;
    this.toldMs = nowMs;
    this.listening.tell(); // ends its connection, too, where nobody looks or hears
    if (!this.shown) return;
    this.traces.tell();
    say(at("finger-text"), this.#whereabouts());
  }

  #whereabouts() {
    const { finger } = this.state;
    if (finger === null) return "Where the finger is, is not known.";
    if (!finger.in_contact) return "No finger touches the screen.";
    const place = `${finger.x_mm.toFixed(0)}, ${finger.y_mm.toFixed(0)} mm`;
    return `The finger touches at ${place}; these words follow it once a second.`;
  }
}

const INVITATION =
  "Take over the finger: press and slide on the screen, or focus it and hold an arrow key.";
const TAKEN = "You are the finger, a simulated one. Let go, and it strokes by itself again.";
const FINGERS = {
  true: "Be the finger: press and slide on the screen, or focus it and hold an arrow key.",
  false: "The finger is a pointer's; moving it needs a token with the scope render.",
  simulated: "The finger is simulated: it strokes by itself.",
  touch: "The finger is a person's, seen by the touch sensor.",
};
