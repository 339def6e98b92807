/** A `discovery/1` or `across-studies/1` document as text and tables. */

import { element } from "../elements/element.js";
import { figure, interval, percent, probability } from "../elements/figures.js";
import { facts, scrolling, table, words } from "../elements/table.js";
import { briefGainOf, gainOf, headlineOf, modelOf, parametersOf, resultOf } from "./words.js";
import { surenessOf, titleOf, verdictOf } from "./words.js";

/**
 * @param {object} found
 * @param {string} sentence the verdict in words
 * @returns {Node[]}
 */
export function report(found, sentence) {
  return [
    ...verdict(found, sentence),
    ...ranking(found.one_recording ?? null),
    ...causes(found),
    ...cannotTell(found.cannot_tell),
    ...unexplained(found.unexplained),
    ...unseen(found.unseen),
    ...tests(found),
    ...origin(found),
  ];
}

/**
 * Of several studies: the answer, what is in the model, and what was left out; the figures are in
 * the report beside it.
 * @param {object} found
 * @returns {Node[]}
 */
export function reportAcross({ sentence, causes: all, studies, left_out: left, notes }) {
  const parts = [element("p", { class: "summary" }, sentence)];
  const said = [...notes, ...left.map(({ path, reason }) => `Left out: ${path}: ${reason}`)];
  if (said.length > 0) parts.push(list("Before you use this", said));
  const inModel = all.filter((cause) => cause.in_model);
  const rows = inModel.map((cause) => [titleOf(cause.id), words(cause.sentence)]);
  if (rows.length > 0) parts.push(table("Causes in the model of all", ["Cause", "In all"], rows));
  const each = studies.map((study) => [words(study.name), words(verdictOf(study.verdict))]);
  parts.push(table("Each study by itself", ["Study", "Verdict"], each));
  return parts;
}

function list(title, lines) {
  const items = lines.map((line) => element("li", {}, line));
  return element("section", {}, heading(title), element("ul", { class: "notes" }, ...items));
}

function paragraph(text) {
  return element("p", {}, text);
}

function heading(text) {
  return element("h3", {}, text);
}

function verdict(found, sentence) {
  const said = element("p", { class: "summary", "data-verdict": found.verdict ?? "none" });
  said.append(headlineOf(found));
  const parts = [said, paragraph(sentence)];
  if (found.gain !== null) parts.push(paragraph(gainOf(found.gain)));
  if (found.gain !== null && found.explained_share !== null) {
    const share = percent(found.explained_share);
    parts.push(paragraph(`Explained: ${share} of what is reproducibly wrong.`));
  }
  if (found.evidence !== null) parts.push(paragraph(found.evidence.statement));
  if (found.notes.length > 0) {
    parts.push(list("Before you use this", found.notes));
  }
  return parts;
}

/** What ranks first in one recording; there is no p of it. */
function ranking(one) {
  if (one === null) return [];
  const head = ["Model", "Of what the base model leaves it takes away", "AIC, less the base model's"];
  const rows = one.models.map((model) => [
    modelOf(model),
    percent(model.explained),
    figure(model.aic, 3),
  ]);
  const tried = `${one.searched} candidates tried; it holds for this recording only`;
  const silent = one.silent.map(titleOf).join(", ");
  return [
    heading("What ranks first in this recording"),
    scrolling(table(tried, head, rows)),
    ...(silent === "" ? [] : [paragraph(`This recording shows nothing of ${silent}.`)]),
  ];
}

function causes({ causes: named }) {
  if (named.length === 0) return [];
  const head = ["Cause", "State", "Size, with interval", "p, of all tested", "Gain, nats"];
  const rows = named.map((cause) => [
    titleOf(cause.id),
    words(surenessOf(cause)),
    words(...parametersOf(cause).map(paragraph)),
    probability(cause.p_value),
    words(briefGainOf(cause)),
  ]);
  return [
    heading("Causes"),
    scrolling(table("Causes that the data name", head, rows)),
    ...named.map(cause),
  ];
}

function cause(named) {
  const alike = named.alternatives.map(({ id, similarity, separating_experiment: how }) => {
    return [`Could be ${titleOf(id)} (similarity ${figure(similarity, 2)})`, how];
  });
  const known = facts([
    ["Gain", named.gain === null ? briefGainOf(named) : gainOf(named.gain)],
    ["Evidence", named.evidence?.statement ?? null],
    ["Next experiment", named.next_experiment],
    ...alike,
  ]);
  const summary = element("summary", {}, `${titleOf(named.id)}: what it rests on`);
  return element("details", {}, summary, paragraph(named.statement), known);
}

function cannotTell(pairs) {
  if (pairs.length === 0) return [];
  const head = ["Either", "Or", "Similarity", "p, that it is either", "What separates them"];
  const rows = pairs.map(({ between: [a, b], similarity, p_value, separating_experiment }) => [
    titleOf(a),
    words(titleOf(b)),
    figure(similarity, 2),
    probability(p_value),
    words(separating_experiment),
  ]);
  return [heading("Cannot tell apart"), scrolling(table("It is one of the two", head, rows))];
}

function unexplained(left) {
  if (left.length === 0) return [];
  const rows = left.map(({ channel, band_hz, covariate, p_value }) => [
    `${channel}, ${interval(band_hz, 3)} Hz`,
    words(covariate === null ? "in all conditions" : `by ${covariate}`),
    probability(p_value),
  ]);
  const head = ["Where", "Follows", "p"];
  return [heading("What stays unexplained"), table("Reproducible, without a cause", head, rows)];
}

function unseen(conditions) {
  if (conditions.length === 0) return [];
  const head = ["Left out", "Size before, dB", "after", "Phase before, °", "after"];
  const rows = conditions.map(({ covariate, level, residual_db: db, residual_deg: deg }) => {
    const left = [...db, ...deg].map((value) => figure(value, 3));
    return [`${covariate} ${figure(level)}`, ...left];
  });
  return [table("Conditions never used to fit: what is left", head, rows)];
}

function tests(found) {
  if (found.tests.length === 0) return [];
  const head = ["Cause", "Result", "Statistic", "p", "Smallest size this design shows"];
  const rows = found.tests.map((test) => {
    const sizes = Object.entries(test.detectable).map((each) => sized(...each, 2));
    return [
      titleOf(test.id),
      words(resultOf(test, found)),
      figure(test.statistic, 3),
      probability(test.p_value),
      words(sizes.join("; ") || "–"),
    ];
  });
  const all = scrolling(table("p values are corrected for all causes together", head, rows));
  const summary = element("summary", {}, "Every cause that was looked for");
  return [...untested(found.tests), element("details", {}, summary, all)];
}

function untested(tests) {
  const rows = tests
    .filter((test) => test.not_tested !== null)
    .map((test) => [titleOf(test.id), words(test.not_tested)]);
  if (rows.length === 0) return [];
  const made = table("These causes were not looked for", ["Cause", "Why not"], rows);
  return [heading("What could not be tested"), made];
}

function origin(found) {
  const { participants, trials, trials_used: used, sha256 } = found.study;
  return [
    heading("Models and data"),
    facts([
      ["Base", model(found.base_model)],
      ["Extended", model(found.extended_model)],
      ["Study", `participants: ${participants}; trials used: ${used} of ${trials}`],
      ["SHA-256", sha256],
      ["Code, seed", `${found.code_version}, ${found.seed}`],
    ]),
  ];
}

function model({ base, effects }) {
  const { law, ...parameters } = base;
  const extended = effects.map(({ id, parameters: own }) => `${titleOf(id)} (${listed(own)})`);
  return [`${titleOf(law)}: ${listed(parameters)}`, ...extended].join("; ");
}

function listed(parameters) {
  return Object.entries(parameters).map((each) => sized(...each)).join(", ");
}

function sized(name, value, digits) {
  return `${name} ${figure(value, digits)}`;
}
