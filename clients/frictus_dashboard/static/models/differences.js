/** What differs between two models, and whether by more than their uncertainties, as tables. */

import { element } from "../elements/element.js";
import { figure, interval, percent } from "../elements/figures.js";
import { scrolling, table, words } from "../elements/table.js";

/**
 * @param {object} found what `/v1/models/compare` answers
 * @param {string} a reference of one model
 * @param {string} b reference of the other
 * @returns {Node[]}
 */
export function differences(found, a, b) {
  return [...quantities(found, a, b), ...effects(found.effects, a, b), ...origins(found, a, b)];
}

function quantities({ parameters, cutoff_hz: cutoffs }, a, b) {
  const rows = [
    ...Object.entries(parameters).map(([name, each]) => row(name, each)),
    ...cutoffs.map((each) => row(`cutoff at ${each.speed_mm_s} mm/s, Hz`, each)),
  ];
  const head = ["Quantity", a, b, "Difference", "95 % interval", "Relative", "Beyond chance"];
  const parts = [scrolling(table(`${b} less ${a}`, head, rows))];
  if (Object.values(parameters).every(({ ci95 }) => ci95 === null)) {
    parts.push(element("p", {}, "Intervals take a covariance in both models."));
  }
  return parts;
}

function row(name, { a, b, difference, ci95, relative }) {
  const beyond = ci95 && (ci95[0] > 0 || ci95[1] < 0 ? "yes" : "no");
  const values = [a, b, difference].map((value) => figure(value));
  return [name, ...values, interval(ci95), percent(relative), beyond ?? "not known"];
}

function effects(found, a, b) {
  const whose = { a: `only ${a}`, b: `only ${b}` };
  const rows = Object.entries(found).map(([id, which]) => {
    return [id.replaceAll("_", " "), words(whose[which] ?? which)];
  });
  return rows.length === 0 ? [] : [table("Effects", ["Effect", "Which model has it"], rows)];
}

function origins({ provenance }, a, b) {
  const told = (value) => (typeof value === "string" ? value : JSON.stringify(value));
  const rows = Object.entries(provenance).map(([name, pair]) => {
    return [name, ...pair.map((value) => words(told(value)))];
  });
  if (rows.length === 0) return [];
  return [scrolling(table("Origin, where it differs", ["What", a, b], rows))];
}
