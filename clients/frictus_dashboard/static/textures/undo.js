/** Steps back and forth through what stood in a form. */

import { element } from "../elements/element.js";
import { button } from "../elements/fields.js";

const MOST = 100;

export class Undo {
  /** @param {(state: object) => void} restore puts back what `note` was given */
  constructor(restore) {
    this.restore = restore;
    this.undo = button("Undo", () => this.#go(-1));
    this.redo = button("Redo", () => this.#go(1));
    this.root = element("span", { class: "actions-row" }, this.undo, this.redo);
    this.begin({});
  }

  /** Begin with a state that nothing stands before. */
  begin(state) {
    this.states = [state];
    this.at = 0;
    this.#offer();
  }

  /** Take a state that the form has come to; one that it had is no step. */
  note(state) {
    if (same(state, this.states[this.at])) return;
    this.states.splice(this.at + 1, Infinity, state);
    if (this.states.length > MOST) this.states.shift();
    this.at = this.states.length - 1;
    this.#offer();
  }

  #go(step) {
    this.at += step;
    this.#offer();
    this.restore(this.states[this.at]);
    // The button that was pressed may have nothing left to do: the hand stays in reach.
    const pressed = step < 0 ? this.undo : this.redo;
    (pressed.disabled ? (step < 0 ? this.redo : this.undo) : pressed).focus();
  }

  #offer() {
    this.undo.disabled = this.at === 0;
    this.redo.disabled = this.at === this.states.length - 1;
  }
}

/** Whether two states of a form are alike. */
export function same(a, b) {
  return JSON.stringify(a) === JSON.stringify(b);
}
