/** What a texture asks for, and what of it a rig could give: drawn, in words, as tables. */

import { request } from "../connection/api.js";
import { element, say } from "../elements/element.js";
import { labelled, number } from "../elements/fields.js";
import { figure } from "../elements/figures.js";
import { Outcome } from "../elements/outcome.js";
import { NOMINAL_HZ } from "../listening/spectrum.js";
import { Plot } from "./plot.js";
import { words } from "./scene.js";
import { Sound } from "./sound.js";

const SPEED_MM_S = 50;
/** Refusals that another try would not change. */
const FINAL = ({ code }) => ["not_feasible", "bad_request", "too_large"].includes(code);
/** The first one makes the service load what it compiles textures with. */
const TIMEOUT_MS = 60_000;
/** Of the values of a course, one in so many is told in the table. */
const TOLD_EVERY = 20;
/** Full scale of sound per newton: as loud as the live view's. */
const PER_N = 1.5;
/** Shown under the strongest band, dB. */
const DEPTH_DB = 50;
const TICKS_HZ = [31.5, 63, 125, 250, 500, 1000];
const COURSE = {
  y: { name: "Friction, N", digits: 4 },
  scales: { x: { time: false } },
  axes: [{ size: 28 }, { size: 64, space: 24 }],
  points: false,
};
const LEVELS = {
  x: { name: "Band, Hz", digits: 1 },
  y: { name: "Level, dB re 1 N rms", digits: 1 },
  scales: { x: { time: false, distr: 3, range: [28, 1_120] }, y: { range: levelRange } },
  axes: [
    { splits: () => TICKS_HZ, values: () => TICKS_HZ.map(named), size: 28 },
    { size: 64, space: 24 },
  ],
  points: true,
};

export class Preview {
  /** @param {Element} into */
  constructor(into) {
    /** Whether another try might tell more; while one is under way, it is not known. */
    this.unsure = false;
    this.speedMmS = SPEED_MM_S;
    this.about = element("p", { class: "about" });
    this.gain = element("p", { class: "gain", role: "status" });
    this.outcome = new Outcome();
    const speed = number({ min: 1, max: 1000 });
    speed.value = SPEED_MM_S;
    speed.addEventListener("change", () => {
      if (!speed.reportValidity()) return;
      this.speedMmS = speed.valueAsNumber;
      this.#renew();
    });
    this.fields = element("div", { class: "fields" });
    this.sound = new Sound("Listen", () => stroked(this.courses, this.speedMmS));
    this.sound.button.title = "As a finger feels what is shown, back and forth at that speed";
    this.fields.append(labelled("Speed of the finger, mm/s", speed), this.sound.button);
    this.image = element("img", { class: "map" });
    this.drawn = element("div", { class: "drawn" });
    into.append(this.about, this.gain, this.outcome.root, this.fields, this.image, this.drawn);
    this.levels = new Plot(this.drawn, LEVELS);
    this.way = new Plot(this.drawn, { ...COURSE, x: { name: "Way, mm", digits: 2 } });
    this.time = new Plot(this.drawn, { ...COURSE, x: { name: "Time, s", digits: 4 } });
    this.clear();
  }

  /** Show nothing. */
  clear() {
    this.texture = this.rig = this.asked = null;
    this.courses = [];
    this.unsure = false;
    this.sound.stop();
    this.outcome.clear();
    for (const part of [this.about, this.gain]) say(part, "");
    for (const part of [this.fields, this.image, this.drawn]) part.hidden = true;
  }

  /** Show a texture for a rig, or for none. @param {object} texture @param {string|null} rig */
  show(texture, rig) {
    const image = texture.kind === "map";
    this.texture = texture;
    this.rig = rig;
    say(this.about, described(texture));
    this.image.hidden = !image;
    this.fields.hidden = image;
    if (image) {
      this.image.src = `data:image/png;base64,${texture.image_png}`;
      this.image.alt = "The map; its first row lies at the smallest y of its region";
    }
    this.#renew();
  }

  async #renew() {
    const { rig, speedMmS } = this;
    const asked = (this.asked = {});
    this.unsure = false;
    say(this.gain, "Working it out…");
    this.drawn.setAttribute("aria-busy", "true");
    this.sound.stop();
    const { found, refused } = await ask(this.texture, rig, speedMmS);
    if (asked !== this.asked) return; // something else was chosen meanwhile
    this.drawn.removeAttribute("aria-busy");
    this.drawn.hidden = found === null || found.courses.length === 0;
    this.unsure = refused !== null && !FINAL(refused);
    say(this.gain, found === null ? "" : gainOf(rig, found.applied, refused));
    if (found === null) {
      this.outcome.bad(`Not known what it would be: ${refused.message}`);
      return;
    }
    this.outcome.clear();
    this.courses = found.courses;
    this.#drawCourse(this.way, found.courses.find(({ per }) => per === "mm"));
    this.#drawCourse(this.time, found.courses.find(({ per }) => per === "s"));
    if (found.rms_n !== null) this.#drawLevels(found.rms_n, speedMmS);
  }

  #drawCourse(plot, course) {
    plot.root.hidden = course === undefined;
    if (course === undefined) return;
    const { per, step, friction_n: friction } = course;
    const x = friction.map((_, i) => i * step);
    const rms = Math.sqrt(friction.reduce((sum, n) => sum + n * n, 0) / friction.length);
    const ends = [Math.min(...friction), Math.max(...friction)].map((n) => figure(n, 3));
    const title = `Friction over ${figure(step * friction.length)} ${per}`;
    plot.show(title, `${ends.join(" to ")} N, ${figure(rms, 3)} N rms`, x, friction, TOLD_EVERY);
  }

  #drawLevels(rms, speed) {
    const levels = rms.map((value) => (value > 0 ? 20 * Math.log10(value) : null));
    const known = levels.filter((level) => level !== null);
    const most = NOMINAL_HZ[levels.indexOf(Math.max(...known))];
    const summary = known.length
      ? `strongest in the band of ${most} Hz, ${Math.max(...known).toFixed(1)} dB`
      : "nothing between 28 and 1122 Hz";
    const title = `Level in third octaves at ${speed} mm/s, dB re 1 N rms`;
    this.levels.show(title, summary, NOMINAL_HZ, levels);
  }
}

/**
 * The friction of courses as sound: a finger goes along them back and forth, so that there is no
 * seam. As loud as on the live view. Pure.
 *
 * @param {Array<{per: string, step: number, friction_n: number[]}>} courses
 * @param {number} speedMmS
 * @returns {{samples: number[], rateHz: number, loop: boolean}|null}
 */
export function stroked(courses, speedMmS) {
  if (courses.length === 0) return null;
  const rates = courses.map(({ per, step }) => (per === "mm" ? speedMmS : 1) / step);
  const rateHz = Math.max(...rates);
  const longest = Math.max(...courses.map(({ friction_n: n }, c) => n.length / rates[c]));
  const samples = Array.from({ length: Math.round(2 * longest * rateHz) }, (_, i) =>
    courses.reduce((sum, { friction_n: friction }, c) => {
      const at = Math.floor((i * rates[c]) / rateHz) % (2 * friction.length);
      return sum + friction[at < friction.length ? at : 2 * friction.length - 1 - at];
    }, 0),
  );
  return { samples: samples.map((n) => Math.min(1, Math.max(-1, PER_N * n))), rateHz, loop: true };
}

/**
 * Ask the service; where it says nothing for the rig, without it.
 *
 * @returns {Promise<{found: object|null, refused: Error|null}>} `refused`: why nothing is said
 *   for the rig, or at all
 */
async function ask(texture, rig, speedMmS) {
  let refused = null;
  for (const of of rig === null ? [{}] : [{ rig }, {}]) {
    const query = new URLSearchParams({ speed_mm_s: speedMmS, ...of });
    const asked = { json: texture, timeoutMs: TIMEOUT_MS };
    try {
      return { found: await request("POST", `/preview?${query}`, asked), refused };
    } catch (error) {
      refused ??= error;
    }
  }
  return { found: null, refused };
}

function gainOf(rig, applied, refused) {
  if (rig === null) return "No rig is present: what of it can be given is not known.";
  if (refused?.code === "not_feasible") return `${rig} cannot render it: ${refused.message}.`;
  if (refused !== null) return `What ${rig} can give of it is not known: ${refused.message}.`;
  return `On ${rig}: feasible gain ${figure(applied.feasible_gain, 3)}; ${words(applied)}.`;
}

/** What a texture is, in a sentence. */
function described(texture) {
  const { kind, rms_n: rms } = texture;
  const along = texture.angle_deg ? `, along ${texture.angle_deg}°` : "";
  const felt = texture.speed_mm_s ? `, as felt at ${texture.speed_mm_s} mm/s` : ", over time";
  if (kind === "spectrum") {
    const count = texture.components.length;
    return `A spectrum of ${count} ${count === 1 ? "component" : "components"}${along}.`;
  }
  if (kind === "profile") {
    const period = texture.period_mm ? `${texture.period_mm} mm` : `${texture.period_s} s`;
    const count = texture.friction_n.length;
    return `A profile of ${count} samples, repeated every ${period}${along}.`;
  }
  if (kind === "beta") {
    const { alpha, beta } = texture;
    return `A beta spectrum, α ${alpha}, β ${beta}, ${rms} N rms${felt}${along}.`;
  }
  if (kind === "slope") {
    const orders = `orders ${texture.low_order} and ${texture.high_order}`;
    return `Noise around ${texture.peak_hz} Hz, ${orders}, ${rms} N rms${felt}${along}.`;
  }
  return `A map from ${texture.black_n} N (black) to ${texture.white_n} N (white).`;
}

function levelRange(_chart, _least, most) {
  const top = most == null ? 0 : 10 * Math.ceil(most / 10);
  return [top - DEPTH_DB, top];
}

function named(hz) {
  return hz < 1_000 ? String(hz) : "1 kHz";
}
