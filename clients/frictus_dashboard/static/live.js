/** The live view of one rig: takes what the service sends, draws it, tells it in words. */

import { Arming } from "./arming.js";
import { Badges } from "./badges.js";
import { onSchemeChange } from "./colours.js";
import { Compensation } from "./compensation.js";
import { at, element, say } from "./element.js";
import { EstimateLog } from "./estimate_log.js";
import { decode } from "./frames.js";
import { Gauge } from "./gauge.js";
import { Health } from "./health.js";
import { holder } from "./holder.js";
import { Listening } from "./listening.js";
import { Pointing } from "./pointing.js";
import { Surface } from "./surface.js";
import { COLUMNS, STREAMS, Traces, WINDOW_S } from "./traces.js";

const WORDS_MS = 1_000;
/** A rig tells its status every second: longer without any word, it is silent. */
const SILENT_MS = 1_700;
const CALM = matchMedia("(prefers-reduced-motion: reduce)");
const CALM_MS = 250;
const STATES = {
  disarmed: "Disarmed",
  armed: "ARMED",
  stopping: "Stopping",
  tripped: "TRIPPED",
};

export class Live {
  /** @param {import("./link.js").Link} link */
  constructor(link) {
    this.link = link;
    this.surface = new Surface(at("surface"));
    this.traces = new Traces(at("traces"));
    this.badges = new Badges(at("badges"));
    this.health = new Health();
    this.arming = new Arming(link);
    this.compensation = new Compensation();
    this.estimates = new EstimateLog();
    this.pointing = new Pointing(this.surface, (message) => link.send(message));
    this.listening = new Listening(at("spectrum"), () => this.state);
    this.speed = new Gauge(at("speed"), { name: "Speed", unit: "mm/s", digits: 0, least: 120 });
    this.force = new Gauge(at("force"), {
      name: "Normal force",
      unit: "N",
      digits: 2,
      least: 0.8,
    });
    this.drawnMs = this.toldMs = -Infinity;
    this.trusted = false;
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
    this.state = { status: null, scene: null, model: null, finger: null };
    this.estimates.clear();
    this.heardMs = -Infinity;
    this.present = false;
    this.#watch();
    this.listening.open(rig);
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
    this.link.watch({
      rig: this.rig,
      streams: this.rig === null || !this.shown ? [] : STREAMS,
      rate_hz: 60,
      columns: COLUMNS,
      window_s: WINDOW_S,
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
  trust(trusted) {
    if (trusted === this.trusted) return;
    this.trusted = trusted;
    if (this.state.status !== null) this.#showStatus();
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
    this.state[message.op] = message[message.op];
    // What a rig last said is kept for late joiners: only a finger or news show that it lives.
    if (message.op === "status" || message.op === "finger") {
      this.heardMs = performance.now();
      this.present = true;
    }
    if (message.op === "status") this.#showStatus();
    if (message.op === "scene") this.#showScene();
    if (message.op === "model") this.#showModel();
    if (message.op === "finger") this.#showFinger();
  }

  /** Take a binary frame. */
  take(buffer) {
    const frame = decode(buffer);
    this.heardMs = performance.now();
    this.traces.push(frame);
    this.badges.note(frame.flags, this.heardMs);
  }

  #showStatus() {
    const { status } = this.state;
    at("state").dataset.state = this.trusted ? status.state : "unknown";
    say(at("state"), this.trusted ? (STATES[status.state] ?? status.state) : "Unknown");
    const held = holder(status, this.link.welcome?.client);
    say(at("owner"), this.trusted ? held : `It said last: ${status.state}`);
    const { fault } = status;
    say(at("fault"), fault === null ? "" : `${fault.kind}: ${fault.reason}. ${fault.action}`);
    this.health.show(status);
    this.surface.setScreen(status.screen_mm);
    const scopes = this.link.welcome?.scopes ?? [];
    this.arming.show(this.rig, status, this.trusted ? scopes : []);
    const may = this.trusted && scopes.includes("render");
    const model = this.state.model?.model ?? null;
    this.compensation.show(this.rig, status, may, this.link.welcome?.client, model);
    const pointer = status.finger_source === "pointer";
    const free = status.owner === null || status.owner === this.link.welcome?.client;
    this.pointing.enable(pointer && free && scopes.includes("render"));
    this.listening.followed = this.pointing.enabled;
    const theirs = `The finger is a pointer's, and ${status.owner} holds the rig.`;
    const finger = FINGERS[pointer ? scopes.includes("render") : status.finger_source];
    say(at("surface-help"), pointer && !free ? theirs : finger);
  }

  #showScene() {
    const { scene, applied, source } = this.state.scene;
    this.surface.setRegions(source === "scene" ? scene.regions : []);
    const gain = `rendered at ${(100 * applied.gain).toFixed(0)} % of the friction asked for`;
    const words = {
      scene: `Scene ${scene.name || "without a name"}, ${gain}`,
      stream: `A client streams a texture to the whole screen, ${gain}`,
      excitation: "An excitation is played, as in a calibration",
    };
    say(at("scene-text"), [words[source], ...applied.notes].join("; "));
    const shown = this.surface.regions.map((region, i) => {
      return element("li", {}, `${region.name || `Region ${i + 1}`}: ${region.texture.kind}`);
    });
    at("regions").replaceChildren(...shown);
  }

  #showModel() {
    const { validity } = this.state.model.model;
    this.speed.setRange(validity.speed_mm_s);
    this.force.setRange(validity.normal_force_n);
  }

  #showFinger() {
    this.surface.setFinger(this.state.finger, performance.now());
  }

  #draw(nowMs) {
    requestAnimationFrame((later) => this.#draw(later));
    this.pointing.tick(nowMs);
    if (CALM.matches && nowMs - this.drawnMs < CALM_MS) return;
    this.drawnMs = nowMs;
    const { finger } = this.state;
    const touching = finger !== null && finger.in_contact;
    this.speed.show(touching ? Math.hypot(finger.vx_mm_s, finger.vy_mm_s) : null, nowMs);
    this.force.show(touching ? finger.normal_force_n : null, nowMs);
    this.badges.show(this.state, nowMs);
    if (this.shown) {
      this.surface.draw(nowMs);
      this.traces.draw();
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
    return `The finger is at ${place}, as its sensor said ${finger.age_ms.toFixed(0)} ms ago.`;
  }
}

const FINGERS = {
  true: "Be the finger: press and slide on the screen, or focus it and hold an arrow key.",
  false: "The finger is a pointer's; moving it needs a token with the scope render.",
  simulated: "The finger is simulated: it strokes by itself.",
  touch: "The finger is a person's, seen by the touch sensor.",
};
