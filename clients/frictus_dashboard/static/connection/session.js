/** What this tab may do, and a way to be let in no longer. */

import { at, say } from "../elements/element.js";
import { forgetToken, token } from "./token.js";

const MAY = {
  read: "look, and stop a rig",
  render: "arm and render",
  calibrate: "calibrate and activate",
  admin: "administer",
};

/** @param {import("./link.js").Link} link */
export function installSession(link) {
  at("forget").addEventListener("click", () => {
    forgetToken();
    link.retry(); // what the page has armed ends with the connection
  });
  link.addEventListener("state", ({ detail }) => {
    at("forget").hidden = token() === null;
    if (detail.state === "open") say(at("session"), sentence(link.welcome));
    if (detail.state === "denied") say(at("session"), "");
  });
}

function sentence({ scopes }) {
  const may = Object.keys(MAY).filter((scope) => scopes.includes(scope));
  const who = token() === null ? "Everybody here may" : "Your token lets you";
  return `${who}: ${may.map((scope) => MAY[scope]).join("; ")}.`;
}
