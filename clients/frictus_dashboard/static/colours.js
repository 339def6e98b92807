/** Colours of style.css for what is drawn on a canvas, in light and in dark. */

const DARK = matchMedia("(prefers-color-scheme: dark)");
const known = new Map();

DARK.addEventListener("change", () => known.clear());

/** The colour of a custom property, such as `--ink`. */
export function colour(name) {
  if (!known.has(name)) {
    known.set(name, getComputedStyle(document.documentElement).getPropertyValue(name).trim());
  }
  return known.get(name);
}

/** Call `redraw` when the scheme changes. */
export function onSchemeChange(redraw) {
  DARK.addEventListener("change", redraw);
}
