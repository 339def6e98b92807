/** Text with commands between backticks, as elements. */

import { element } from "./element.js";

/** @param {string} text such as "run `frictus discover`" @returns {Node[]} */
export function coded(text) {
  return text.split("`").map((part, i) => {
    return i % 2 === 1 ? element("code", {}, part) : document.createTextNode(part);
  });
}
