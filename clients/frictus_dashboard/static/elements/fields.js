/** Labelled fields of a form. */

import { element } from "./element.js";

/** A control below its label. */
export function labelled(text, control) {
  return element("label", {}, text, control);
}

/** Take away a labelled field that does not apply: what stands in it is not judged either. */
export function apply(label, applies) {
  label.hidden = !applies;
  label.control.disabled = !applies;
}

/**
 * A field for a number; `optional` ones may stay empty.
 *
 * @param {{min?: number, max?: number, step?: number|"any", optional?: boolean}} limits
 */
export function number({ min, max, step = "any", optional = false } = {}) {
  const made = element("input", { type: "number", step });
  if (min !== undefined) made.min = min;
  if (max !== undefined) made.max = max;
  made.required = !optional;
  return made;
}

/** A field for a name of the library. */
export function name() {
  return element("input", {
    type: "text",
    required: "",
    maxlength: 64,
    pattern: "[a-z0-9][a-z0-9_\\-]*",
    title: "Lower-case letters, digits, - and _, beginning with a letter or digit",
    autocomplete: "off",
    spellcheck: "false",
  });
}

/** A choice. @param {Array<[string, string]>} options value and text of each */
export function choice(options) {
  return element("select", {}, ...optionsOf(options));
}

/** The options of a choice. */
export function optionsOf(options) {
  return options.map(([value, text]) => element("option", { value }, text));
}

/** A button. @param {string} text @param {(event: MouseEvent) => void} press */
export function button(text, press) {
  const made = element("button", { type: "button" }, text);
  made.addEventListener("click", press);
  return made;
}

/** The number in a field; null where an optional one is empty. */
export function numberIn(control) {
  return control.value === "" ? null : control.valueAsNumber;
}
