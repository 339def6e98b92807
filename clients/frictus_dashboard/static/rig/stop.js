/** The stop: on screen, on keys, sent at once, sent again until it is answered. */

import { Refusal, request } from "../connection/api.js";
import { at, say } from "../elements/element.js";

const TRY_MS = 800;
const PAUSE_MS = 200;
/** How long an answer is shown: from then on the strip says what there is to know. */
const SHOWN_MS = 10_000;
/** Answers that another try would not change. */
const FINAL = (error) => error instanceof Refusal && error.status < 500 && error.status !== 429;

/**
 * Stop one rig.
 *
 * @param {string} rig
 * @param {(text: string) => void} tell
 * @param {() => boolean} wanted false once a newer stop has taken over
 * @returns {Promise<boolean>} whether it was answered as asked
 */
async function stopRig(rig, tell, wanted) {
  for (let tries = 1; wanted(); tries++) {
    try {
      const path = `/rigs/${encodeURIComponent(rig)}/stop`;
      const { state } = await request("POST", path, { timeoutMs: TRY_MS });
      if (wanted()) tell(`${rig} answered the stop: ${state}`);
      return true;
    } catch (error) {
      if (!wanted()) return false;
      if (FINAL(error)) {
        tell(`${rig} was not stopped: ${error.message}. Switch the amplifier off.`);
        return false;
      }
      tell(`${rig}: stop sent ${tries} times, no answer yet. Switch the amplifier off.`);
    }
    await new Promise((resume) => setTimeout(resume, PAUSE_MS));
  }
  return false;
}

/**
 * Make the button and the keys stop. Escape stops from everywhere, Space where no control has
 * the focus that takes it.
 *
 * @param {() => string[]} rigs names of those to stop
 */
export function installStop(rigs) {
  const button = at("stop");
  const outcome = at("stop-outcome");
  let newest = 0;

  function stop() {
    const mine = ++newest;
    const told = new Map(rigs().map((rig) => [rig, `${rig}: stopping…`]));
    const when = new Date().toTimeString().slice(0, 8);
    const show = () => say(outcome, `${when} ${[...told.values()].join("; ")}`);
    const wanted = () => mine === newest;
    const stopping = [...told.keys()].map((rig) => {
      return stopRig(rig, (text) => (told.set(rig, text), show()), wanted);
    });
    Promise.all(stopping).then((answered) => {
      if (!answered.length || answered.includes(false)) return; // that stays
      setTimeout(() => wanted() && say(outcome, ""), SHOWN_MS);
    });
    if (told.size === 0) {
      told.set("", "Nothing was stopped: this page knows of no rig. Is one driven? Switch its amplifier off.");
    }
    show();
  }

  const TAKES_SPACE = "button, a, input, select, textarea, summary";
  const takesSpace = (target) => target instanceof Element && target.matches(TAKES_SPACE);
  button.addEventListener("click", ({ detail }) => {
    stop();
    if (detail > 0) button.blur(); // pressed by a hand: Enter, which begins and answers, is no stop
  });
  document.addEventListener(
    "keydown",
    (event) => {
      if (event.repeat || event.ctrlKey || event.altKey || event.metaKey) return;
      const space = event.code === "Space" && !takesSpace(event.target);
      if (event.key !== "Escape" && !space) return;
      if (space) event.preventDefault(); // or the page would scroll
      stop();
    },
    { capture: true },
  );
}
