/** What the browser keeps for the page; where it may keep nothing, the page does while it is open. */

class Memory {
  #values = new Map();

  getItem(key) {
    return this.#values.get(key) ?? null;
  }

  setItem(key, value) {
    this.#values.set(key, value);
  }

  removeItem(key) {
    this.#values.delete(key);
  }
}

function storageOf(name) {
  try {
    return window[name] ?? new Memory();
  } catch (error) {
    if (error.name !== "SecurityError") throw error; // cookies are blocked, and this with them
    return new Memory();
  }
}

/** Until the tab is closed. */
export const TAB = storageOf("sessionStorage");
/** For good. */
export const BROWSER = storageOf("localStorage");
