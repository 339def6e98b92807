/** The figures of a report, taken out of the page that the service made of it. */

import { send } from "../connection/api.js";
import { element } from "../elements/element.js";

/** Alone: the style of that page is none of this one, which would complain of it. */
const FIGURES = /<figure>.*?<\/figure>/gs;
const PICTURE = 'img[src^="data:image/png;base64,"]';

/**
 * Pictures with their captions; nothing else of that page is taken over.
 *
 * @param {string} path of the discovery below /v1
 * @param {AbortSignal} signal
 * @returns {Promise<HTMLElement[]>}
 */
export async function picturesOf(path, signal) {
  const answer = await send("GET", `${path}/report.html`, { signal });
  const figures = (await answer.text()).match(FIGURES) ?? [];
  const page = new DOMParser().parseFromString(figures.join(""), "text/html");
  return [...page.querySelectorAll("figure")].flatMap((figure) => {
    const picture = figure.querySelector(PICTURE);
    return picture === null ? [] : [drawn(picture, figure.querySelector("figcaption"))];
  });
}

function drawn({ src, alt }, caption) {
  const made = element("figure", {}, element("img", { src, alt }));
  const told = caption?.textContent.replaceAll(/\s+/g, " ").trim();
  if (told) made.append(element("figcaption", { class: "quiet" }, told));
  return made;
}
