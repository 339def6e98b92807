/** The token of this tab: kept until it is closed, never in a URL. */

import { at, say } from "../elements/element.js";
import { TAB } from "../storage.js";

const KEY = "frictus-token";

/** The token, or null. */
export function token() {
  return TAB.getItem(KEY);
}

/** Keep it no longer. */
export function forgetToken() {
  TAB.removeItem(KEY);
}

/** Ask for a token, with the reason why; `use` is called once there is one. */
export function askForToken(why, use) {
  const dialog = at("token-dialog");
  const input = at("token");
  say(at("token-why"), why);
  if (dialog.open) return;
  input.value = "";
  dialog.onclose = () => {
    if (input.value) {
      TAB.setItem(KEY, input.value);
      input.value = "";
    }
    use();
  };
  dialog.show(); // not modal: the stop stays within reach
  input.focus();
}
