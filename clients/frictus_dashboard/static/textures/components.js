/** The components of a spectrum, one row each. */

import { element } from "../elements/element.js";
import { button, choice, number } from "../elements/fields.js";

const UNITS = [
  ["cycles_per_mm", "cycles/mm"],
  ["hz", "Hz"],
];
const FORMULA = "amplitude · cos(2π · frequency · u + phase), u: way in mm or time in s";
const LEAST = 1e-6;
/** As the service takes them. */
const MOST = { cycles_per_mm: 1_000, hz: 10_000 };
const MOST_ROWS = 4_096;
const HEAD = ["No.", "Amplitude, N", "Frequency", "Unit", "Phase, rad"];

export class Components {
  /** @param {Element} into @param {() => void} changed called when a row goes or comes */
  constructor(into, changed) {
    this.changed = changed;
    this.body = element("tbody");
    const head = HEAD.map((text) => element("th", { scope: "col" }, text));
    const table = element(
      "table",
      {},
      element("caption", { class: "quiet" }, FORMULA),
      element("thead", {}, element("tr", {}, ...head, element("td"))),
      this.body,
    );
    const scroll = element("div", { class: "rows", tabindex: 0, role: "group" }, table);
    scroll.setAttribute("aria-label", "Components of the spectrum");
    this.add = button("Add a component", () => {
      const made = this.#row({ amplitude_n: 0.02, cycles_per_mm: 1, phase_rad: 0 });
      this.body.append(made);
      this.#name();
      made.querySelector("input").focus();
      made.querySelector("input").select(); // typing replaces what it begins with
      this.changed();
    });
    into.append(scroll, this.add);
  }

  /** Fill the rows. @param {object[]} components */
  show(components) {
    this.body.replaceChildren(...components.map((component) => this.#row(component)));
    this.#name();
  }

  /** The components that stand in the rows. */
  read() {
    return [...this.body.rows].map((row) => {
      const [amplitude, frequency, unit, phase] = row.querySelectorAll("input, select");
      return {
        amplitude_n: amplitude.valueAsNumber,
        [unit.value]: frequency.valueAsNumber,
        phase_rad: phase.valueAsNumber,
      };
    });
  }

  #row({ amplitude_n: amplitude, cycles_per_mm: turns, hz, phase_rad: phase }) {
    const [frequency, unit] = [number({ min: LEAST }), choice(UNITS)];
    const cells = [number({ min: 0, max: 10 }), frequency, unit, number()];
    const values = [amplitude, turns ?? hz, turns == null ? "hz" : "cycles_per_mm", phase];
    cells.forEach((cell, i) => (cell.value = values[i]));
    const limit = () => (frequency.max = MOST[unit.value]);
    unit.addEventListener("change", limit);
    limit();
    const remove = button("Remove", () => {
      const next = row.nextElementSibling ?? row.previousElementSibling;
      row.remove();
      this.#name();
      next.querySelector("input").focus();
      this.changed();
    });
    const row = element("tr", {}, element("th", { scope: "row" }));
    row.append(...[...cells, remove].map((cell) => element("td", {}, cell)));
    return row;
  }

  #name() {
    const alone = this.body.rows.length === 1;
    this.add.disabled = this.body.rows.length >= MOST_ROWS;
    [...this.body.rows].forEach((row, i) => {
      row.cells[0].textContent = i + 1;
      row.querySelectorAll("input, select, button").forEach((control, column) => {
        const what = column === 4 ? "Remove" : HEAD[column + 1];
        control.setAttribute("aria-label", `${what}, component ${i + 1}`);
      });
      row.querySelector("button").disabled = alone; // a spectrum has at least one
    });
  }
}
