/** Colours of style.css for what is drawn on a canvas, in light and in dark. */

const DARK = matchMedia("(prefers-color-scheme: dark)");
/** Has a colour as it is drawn: a property alone may hold one for light and one for dark. */
const swatch = document.createElement("span");
const known = new Map();
const redraws = [];

swatch.hidden = true;
document.body.append(swatch);
DARK.addEventListener("change", changeScheme);

function changeScheme() {
  known.clear();
  for (const redraw of redraws) redraw();
}

/** Draw in one scheme, or in that of the system. @param {"light dark"|"light"|"dark"} scheme */
export function chooseScheme(scheme) {
  document.documentElement.style.colorScheme = scheme;
  changeScheme();
}

/** The colour of a custom property, such as `--ink`, as `#14181d`. */
export function colour(name) {
  if (!known.has(name)) known.set(name, drawn(name));
  return known.get(name);
}

function drawn(name) {
  swatch.style.color = `var(${name})`;
  const parts = getComputedStyle(swatch).color.match(/\d+/g).slice(0, 3); // rgb(20, 24, 29)
  return `#${parts.map((part) => Number(part).toString(16).padStart(2, "0")).join("")}`;
}

/** Call `redraw` when the scheme changes. */
export function onSchemeChange(redraw) {
  redraws.push(redraw);
}
