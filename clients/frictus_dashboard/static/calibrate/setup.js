/** What a new calibration is asked to do: a form, and the request that it makes. */

import { request } from "../connection/api.js";
import { element, say } from "../elements/element.js";
import { choice, labelled } from "../elements/fields.js";
import { heldAlready } from "../rig/holder.js";
import { Outcome } from "../elements/outcome.js";

/** What the service accepts; `per`: how many of what is shown make one. */
const NUMBERS = {
  approach_s: { label: "Approach, s", max: 60 },
  record_s: { label: "Recorded, s", min: 0.5, max: 120 },
  precision: { label: "Precision, %", min: 0.001, max: 100, per: 100 },
  max_recorded_s: { label: "Longest recording, s", min: 0.5, max: 7200 },
  trials_per_block: { label: "Trials until a break", min: 1, step: 1 },
  break_s: { label: "Break, s", max: 3600 },
  max_repeats: { label: "Most repeats of a rejected trial", max: 100, step: 1 },
};
const LISTS = {
  speeds_mm_s: { label: "Speeds, mm/s" },
  forces_n: { label: "Forces, N" },
  tones_hz: { label: "Tones, Hz", hint: "15, 30 Hz to 2 kHz" },
};
const SWITCHES = { use_prior: { label: "Learn from earlier people's models" } };
const LIST = "[,; ]*\\d+(\\.\\d+)?([,; ]+\\d+(\\.\\d+)?)*[,; ]*";
/** Fields per protocol, as they begin; `kind` where it is another's with other numbers. */
const PROTOCOLS = {
  quick: {
    title: "Quick: all tones at once, until it is precise",
    fields: {
      speeds_mm_s: "20, 25, 30, 90, 95, 100",
      forces_n: "0.2, 0.3, 0.4, 0.5, 0.6",
      precision: "5",
      max_recorded_s: "120",
      approach_s: "2",
      record_s: "2.5",
      max_repeats: "5",
      use_prior: true,
    },
  },
  paper: {
    title: "Paper: one tone per trial, 375 trials",
    fields: {
      speeds_mm_s: "20, 40, 60, 80, 100",
      forces_n: "0.2, 0.3, 0.4, 0.5, 0.6",
      tones_hz: "",
      approach_s: "7",
      record_s: "10",
      trials_per_block: "15",
      break_s: "10",
      max_repeats: "5",
    },
  },
  discovery: {
    title: "For discovery: 72 trials, 5 minutes",
    kind: "paper",
    fields: {
      speeds_mm_s: "20, 45, 75, 100",
      forces_n: "0.2, 0.4, 0.6",
      tones_hz: "35, 80, 180, 400, 850, 1700",
      approach_s: "2",
      record_s: "2",
      trials_per_block: "36",
      break_s: "10",
      max_repeats: "5",
    },
  },
};

export class Setup {
  /**
   * @param {Element} root
   * @param {(calibration: object) => void} started
   */
  constructor(root, started) {
    this.started = started;
    this.rig = null;
    /** What was sent and not answered: sent again, it must not start a second one. */
    this.pending = null;
    this.participant = element("input", {
      name: "participant",
      required: "",
      maxlength: "64",
      pattern: "[A-Za-z0-9._\\-]+",
      title: "A pseudonym: letters, digits, '.', '_' and '-'",
      autocomplete: "off",
    });
    this.session = number("1", { step: 1 });
    this.protocol = choice(Object.entries(PROTOCOLS).map(([kind, { title }]) => [kind, title]));
    this.settings = Object.fromEntries(
      Object.entries(PROTOCOLS).map(([kind, { fields }]) => [kind, new Settings(fields)]),
    );
    this.begin = element("button", { type: "submit" }, "Arm the rig and start");
    this.holder = element("p", { class: "quiet" });
    this.outcome = new Outcome();
    root.append(this.#form());
    this.protocol.addEventListener("change", () => this.#choose());
    this.#choose();
  }

  /** @param {string|null} rig the one to calibrate */
  open(rig) {
    if (rig !== this.rig) {
      this.outcome.clear();
      this.show({ owner: null }, "");
    }
    this.rig = rig;
  }

  /**
   * A calibration arms the rig by itself, so nobody may hold it.
   *
   * @param {object} status the rig's @param {string} client name of this page to the rigs
   */
  show({ owner }, client) {
    this.begin.disabled = owner !== null;
    say(this.holder, heldAlready(this.rig, owner, client));
  }

  #form() {
    const settings = Object.values(this.settings).map(({ root }) => root);
    const more = element("details", {}, element("summary", {}, "Settings"), ...settings);
    // What is wrong is to be seen.
    more.addEventListener("invalid", () => (more.open = true), { capture: true });
    const form = element(
      "form",
      { class: "setup" },
      element(
        "div",
        { class: "fields" },
        labelled("Participant", this.participant),
        labelled("Protocol", this.protocol),
        labelled("Session", this.session),
      ),
      more,
      element(
        "p",
        {},
        this.begin,
        " This puts voltage on the screen, until the last trial or a stop.",
      ),
      this.holder,
      this.outcome.root,
    );
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.#start();
    });
    return form;
  }

  #choose() {
    for (const [kind, settings] of Object.entries(this.settings)) {
      settings.root.hidden = settings.root.disabled = kind !== this.protocol.value;
    }
  }

  async #start() {
    this.outcome.clear();
    const made = await this.outcome.of(this.#send(), "Not started");
    if (made !== null) this.started(made);
  }

  async #send() {
    const name = this.protocol.value;
    const asked = {
      rig: this.rig,
      participant: this.participant.value,
      session: this.session.valueAsNumber,
      protocol: { kind: PROTOCOLS[name].kind ?? name, ...this.settings[name].values },
    };
    const same = JSON.stringify(asked);
    if (this.pending?.same !== same) {
      this.pending = { same, key: random(4).join("-"), seed: random(1)[0] };
    }
    const { key, seed } = this.pending;
    const options = { json: { ...asked, seed }, headers: { "Idempotency-Key": key } };
    try {
      const made = await request("POST", "/calibrations", options);
      this.pending = null;
      return made;
    } catch (error) {
      if (error.status < 500) this.pending = null; // refused: that is an answer
      throw error;
    }
  }
}

/** The settings of one protocol. */
class Settings {
  constructor(fields) {
    this.inputs = Object.entries(fields).map(([name, value]) => [name, made(name, value)]);
    const labels = this.inputs.map(([name, input]) => {
      return labelled((NUMBERS[name] ?? LISTS[name] ?? SWITCHES[name]).label, input);
    });
    this.root = element("fieldset", { class: "fields" }, ...labels);
    this.root.setAttribute("aria-label", "Settings of the protocol");
  }

  /** As the service wants them. */
  get values() {
    return Object.fromEntries(this.inputs.map(([name, input]) => [name, read(name, input)]));
  }
}

function made(name, value) {
  if (name in SWITCHES) {
    const input = element("input", { type: "checkbox", name });
    input.checked = value;
    return input;
  }
  if (name in NUMBERS) {
    const { min, max = "", step } = NUMBERS[name];
    return number(value, { name, min, max, step });
  }
  const { hint } = LISTS[name];
  const title = "Numbers with commas between them";
  const input = element("input", { name, value, title, pattern: LIST });
  if (hint) input.placeholder = hint;
  else input.required = true;
  return input;
}

function read(name, input) {
  if (name in SWITCHES) return input.checked;
  if (name in NUMBERS) return input.valueAsNumber / (NUMBERS[name].per ?? 1);
  const values = input.value.split(/[,; ]+/).filter(Boolean).map(Number);
  return values.length === 0 ? null : values;
}

function number(value, { min = 0, step = "any", ...others }) {
  return element("input", { type: "number", required: "", value, min, step, ...others });
}

/** Whole numbers below 2^31; a page that is not served over TLS has no randomUUID. */
function random(count) {
  return [...crypto.getRandomValues(new Uint32Array(count))].map((value) => value >>> 1);
}
