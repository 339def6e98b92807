/** Friction sample by sample, over a connection of its own while it is looked at or heard. */

import { at, say } from "../elements/element.js";
import { Felt } from "./felt.js";
import { decode } from "../connection/frames.js";
import { Hearing } from "./hearing.js";
import { Levels } from "./levels.js";
import { Link } from "../connection/link.js";
import { Spectrogram } from "./spectrogram.js";
import { untold } from "./target.js";
import { token } from "../connection/token.js";

export class Listening {
  /**
   * @param {Element} root figure for the spectrum
   * @param {() => object} state what the watched rig has said
   */
  constructor(root, state) {
    this.state = state;
    this.felt = new Felt();
    this.levels = new Levels(root);
    this.spectrogram = new Spectrogram(at("spectrogram"));
    this.hearing = new Hearing();
    this.link = null;
    this.rig = null;
    /** Whether the view is; hearing goes on without it. */
    this.shown = true;
    this.visible = false;
    /** Somebody moves the finger by this page: the spectrum follows even out of sight. */
    this.followed = false;
    new IntersectionObserver(([{ isIntersecting }]) => {
      this.visible = isIntersecting;
    }).observe(root.parentElement); // with it what else is made of the friction
  }

  open(rig) {
    this.rig = rig;
    this.felt.clear();
    this.spectrogram.clear();
    this.link?.end();
    this.link = null;
  }

  redraw() {
    this.levels.redraw();
    this.spectrogram.redraw();
  }

  draw() {
    this.spectrogram.draw();
  }

  /** Bring chart and words up to date; connect and disconnect as need be. */
  tell() {
    const { status, scene, model } = this.state();
    const known = status !== null && status.simulated;
    at("hearing").hidden = at("spectrogram").hidden = !known;
    const looked = this.shown && (this.visible || this.followed) && !document.hidden;
    this.#connect(known && (this.hearing.on || looked));
    say(at("spectrum-note"), this.#note(status, scene));
    this.spectrogram.tell();
    this.levels.show(known ? this.felt.spectra : null, model?.model.base ?? null);
  }

  #note(status, scene) {
    if (status === null) return "";
    if (!status.simulated) {
      return "Friction at the finger is known on simulated rigs only: no device measures it.";
    }
    const missing = scene === null ? "" : untold(scene);
    const last = this.felt.spectra === null ? "" : " Shown is what was felt last.";
    const idle = status.state === "armed" ? this.felt.why : `Not armed: nothing is rendered.${last}`;
    return [missing, idle].filter(Boolean).join(" ");
  }

  #connect(wanted) {
    if (!wanted) {
      this.link?.end();
      this.link = null;
    } else if (this.link === null) {
      this.link = new Link(token);
      this.link.addEventListener("frame", ({ detail }) => this.#take(decode(detail)));
      this.link.watch({ rig: this.rig, streams: ["truth"], rate_hz: 60, columns: 500, raw: true });
      this.link.retry();
    }
  }

  #take(frame) {
    this.hearing.push(frame);
    this.spectrogram.push(frame);
    const { status, scene } = this.state();
    if (status?.state !== "armed" || scene === null) return;
    const { mode, speed_mm_s } = status.compensation;
    // What was felt of another scene, or in another mode, is not averaged with this.
    const felt = [scene.etag, mode, speed_mm_s].join();
    if (felt !== this.feltOf) this.felt.clear();
    this.feltOf = felt;
    const told = untold(scene) === "";
    const { regions } = scene.scene;
    this.felt.push(frame, told ? { regions, gain: scene.applied.gain } : null);
  }
}
