/** The page: which view of which rig is shown (`#/live/rig1`), and how the connection stands. */

import { address, ALONE, isRigName, route, VIEWS } from "./address.js";
import { actAs } from "./connection/api.js";
import { installAppearance } from "./appearance.js";
import { at, element, say } from "./elements/element.js";
import { clock } from "./elements/figures.js";
import { FirstSteps, firstStepOf } from "./first_steps.js";
import { knowAsOwn } from "./rig/holder.js";
import { Link } from "./connection/link.js";
import { Live } from "./live/view.js";
import { installSession } from "./connection/session.js";
import { installStop } from "./rig/stop.js";
import { hasEnded } from "./strip/strip_state.js";
import { askForToken, token } from "./connection/token.js";
import { linksTo, Page, Views } from "./views.js";

const LOOK_MS = 200;
/** How long it is news that an interruption is over; then it is told under the pointer alone. */
const NEWS_MS = 60_000;
const link = new Link(token, () => (route(location.hash).view === ALONE ? ALONE : null));
const live = new Live(link);
const views = new Views(new Page(link, live));
const first = new FirstSteps();
/** What the address names. */
let routed = route("#/");
/** Rigs that are present, and whether the service has its router; null: not told yet. */
let present = { rigs: [], link: null };
/** When what is shown was interrupted last, and when that was over, ms; null: never, not yet. */
let interruptedMs = null;
let resumedMs = null;

function follow() {
  // Anything else is a place on this page.
  if (location.hash === "" || location.hash.startsWith("#/")) routed = route(location.hash);
  const rig = routed.rig ?? live.rig ?? present.rigs[0] ?? null;
  if (rig !== live.rig) {
    interruptedMs = resumedMs = null;
    live.open(rig);
  }
  views.show(routed.view, rig, routed.rest);
  at("views").replaceChildren(...linksTo(routed.view, live.rig));
  showRigs();
  look();
}

function showRigs() {
  const names = [...new Set([...present.rigs, ...(live.rig === null ? [] : [live.rig])])];
  const items = names.sort().map((name) => {
    const here = present.rigs.includes(name);
    const text = here ? name : `${name} (gone)`;
    const anchor = element("a", { href: address(routed.view, name) }, text);
    if (name === live.rig) anchor.setAttribute("aria-current", "page");
    const item = element("li", {}, anchor);
    item.dataset.present = here;
    return item;
  });
  at("rigs").replaceChildren(...items);
}

/** Say how the connection stands; nothing else on the page claims more than this. */
function look() {
  const { state, text, advice } = standing();
  const before = at("connection").dataset.state;
  if (state === "lost" && before === "live") {
    interruptedMs = Date.now();
    resumedMs = null;
  }
  if (state === "live" && interruptedMs !== null) resumedMs ??= Date.now();
  const connected = link.state === "open" && !link.quiet && present.link === true;
  live.trust(state === "live", connected && !present.rigs.includes(live.rig));
  const box = at("connection");
  box.dataset.state = state;
  say(box, text);
  box.title = interruption();
  const rig = live.rig === null ? "No rig" : `Rig ${live.rig}`;
  const alone = routed.view === "live";
  say(at("title"), alone ? rig : `${VIEWS[routed.view]} · ${rig}`);
  at("title").classList.toggle("unseen", alone && live.state.status !== null); // listed above
  say(at("advice"), advice);
  at("advice").hidden = advice === "";
  const { status, scene } = live.state;
  const stage = status?.finger_takeover === true;
  const tripped = status?.state === "tripped";
  const heard = { connected, rig: live.rig, scene, trusted: live.trusted, tripped, stage };
  first.show(alone ? firstStepOf(heard) : { kind: "none" }, live.rig);
  at("rig").hidden = live.state.status === null;
  at("rig").classList.toggle("past", state !== "live");
  const where = alone ? "" : `${VIEWS[routed.view]}, `;
  document.title = `${where}${live.rig ?? "no rig"}: ${text} · frictus`;
}

function standing() {
  if (link.state === "denied") {
    return { state: "denied", text: `Not let in: ${link.reason}`, advice: "" };
  }
  if (link.state !== "open") {
    const first = link.welcome === null && link.reason === "";
    return first
      ? { state: "connecting", text: "Connecting to the service…", advice: "" }
      : {
          state: "lost",
          text: "No connection to the service; trying again",
          advice: `What you see is from before (${link.reason}). The rig may run on.`,
        };
  }
  if (link.quiet) {
    const advice = "What you see is from before. The rig may run on.";
    return { state: "lost", text: "No word from the service", advice };
  }
  if (present.link === false) {
    const advice = "Start the router, for example by frictus serve; this page will notice.";
    return { state: "lost", text: "The service has no router", advice };
  }
  if (live.rig === null) {
    // The live view says it at length.
    const advice = routed.view === "live" ? "" : "Start one with frictus rig; this page will notice.";
    return { state: "waiting", text: "Connected; no rig is present", advice };
  }
  return standingOfRig();
}

/** When what is shown was interrupted last, in words; empty: it never was. */
function interruption() {
  if (interruptedMs === null) return "";
  return `interrupted at ${clock(1e6 * interruptedMs, 1e6 * Date.now())}`;
}

function standingOfRig() {
  const { rig } = live;
  if (!isRigName(rig)) {
    const advice = "No rig can be called so; accepted in the address: 1 to 64 letters, digits, ., _, -.";
    return { state: "waiting", text: `${rig} is not present`, advice };
  }
  const here = present.rigs.includes(rig);
  if (here && live.alive) {
    const news = interruptedMs !== null && Date.now() - (resumedMs ?? Infinity) <= NEWS_MS;
    const text = news ? `Live again; ${interruption()}` : "Live";
    return { state: "live", text, advice: "" };
  }
  if (live.state.status === null) {
    const text = here ? `${rig} is starting` : `${rig} is not present`;
    return { state: "waiting", text, advice: here ? "" : "This page will notice when it comes." };
  }
  if (hasEnded({ gone: !here, status: live.state.status })) {
    const advice = "This page will notice its return.";
    return { state: "lost", text: `${rig} has ended`, advice };
  }
  const advice = "What you see is the last that came from it. This page will notice its return.";
  return { state: "lost", text: here ? `${rig} is silent` : `${rig} is gone`, advice };
}

link.addEventListener("state", ({ detail }) => {
  actAs(detail.state === "open" ? link.welcome.key : null);
  if (detail.state === "open") {
    knowAsOwn(link.welcome.client);
    say(at("site"), link.welcome.site);
  } else {
    live.lose();
    live.arming.drop();
  }
  if (detail.code === "unauthenticated") askForToken(detail.reason, () => link.retry());
  look();
});
link.addEventListener("message", ({ detail }) => {
  if (detail.op === "rigs") {
    present = detail;
    follow();
  } else {
    live.hear(detail);
    views.hear(detail);
    if (detail.op === "lost") look();
  }
});
link.addEventListener("frame", ({ detail }) => live.take(detail));
addEventListener("hashchange", follow);
setInterval(look, LOOK_MS);
installAppearance();
installSession(link);
installStop(() => (isRigName(live.rig) ? [live.rig] : present.rigs));
follow();
link.retry();
