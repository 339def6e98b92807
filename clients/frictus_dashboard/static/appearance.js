/** Light or dark, roomy or dense: chosen at the foot of the page, and kept by this browser. */

import { chooseScheme } from "./canvas/colours.js";
import { at, element } from "./elements/element.js";
import { button } from "./elements/fields.js";
import { BROWSER } from "./storage.js";

/** Each choice: its title, what it does, and its values by name; the first holds until one is made. */
const CHOICES = {
  theme: {
    title: "Theme",
    apply: chooseScheme,
    values: { System: "light dark", Light: "light", Dark: "dark" },
  },
  density: {
    title: "Density",
    apply: (density) => (document.documentElement.dataset.density = density),
    values: { Roomy: "roomy", Dense: "dense" },
  },
};

export function installAppearance() {
  const groups = Object.entries(CHOICES).map(([name, choice]) => {
    return switchOf(`frictus-${name}`, choice);
  });
  at("appearance").replaceChildren(...groups);
}

function switchOf(key, { title, apply, values }) {
  const buttons = Object.entries(values).map(([label, value]) => {
    const made = button(label, () => {
      BROWSER.setItem(key, value);
      choose(value);
    });
    made.value = value;
    return made;
  });
  const choose = (value) => {
    apply(value);
    for (const each of buttons) each.setAttribute("aria-pressed", String(each.value === value));
  };
  const [first] = Object.values(values);
  const kept = BROWSER.getItem(key);
  choose(Object.values(values).includes(kept) ? kept : first);
  const group = element("span", { class: "segments", role: "group" }, ...buttons);
  group.setAttribute("aria-label", title);
  return element("p", {}, `${title} `, group);
}
