/** Tables and lists of facts, from texts and elements. */

import { element } from "./element.js";

/** A table whose first column names its rows; other cells of words are made by `words`. */
export function table(caption, head, rows = []) {
  const columns = head.map((title) => element("th", { scope: "col" }, title));
  const made = element(
    "table",
    {},
    element("caption", { class: "quiet" }, caption),
    element("thead", {}, element("tr", {}, ...columns)),
    element("tbody"),
  );
  fill(made, rows);
  return made;
}

/**
 * Give a table other rows.
 *
 * @param {HTMLTableElement} made by `table`
 * @param {(Node|string)[][]} rows
 */
export function fill(made, rows) {
  const filled = rows.map(([name, ...cells]) => {
    const named = element("th", { scope: "row" }, name);
    return element("tr", {}, named, ...cells.map(cell));
  });
  made.tBodies[0].replaceChildren(...filled);
  for (const [i, title] of [...made.tHead.rows[0].cells].entries()) {
    title.classList.toggle("words", filled[0]?.cells[i]?.classList.contains("words") ?? false);
  }
}

/** A cell of words, which begin at the left. */
export function words(...content) {
  return element("td", { class: "words" }, ...content);
}

/** A table that may be wider than its place, in one that scrolls; `wraps`: its cells break first. */
export function scrolling(made, wraps = false) {
  const kind = wraps ? "scroll wraps" : "scroll";
  const place = element("div", { class: kind, role: "region", tabindex: "0" }, made);
  place.setAttribute("aria-label", made.caption.textContent);
  return place;
}

/** Names with what they stand for; what is null is left out. */
export function facts(pairs) {
  const known = pairs.filter(([, value]) => value !== null && value !== "");
  const parts = known.flatMap(([name, value]) => [
    element("dt", {}, name),
    element("dd", {}, value),
  ]);
  return element("dl", { class: "facts" }, ...parts);
}

function cell(content) {
  const made = content instanceof HTMLTableCellElement;
  return made ? content : element("td", {}, content);
}
