/** Where an experiment stands, in the experimenter's words. Pure. */

import { figure } from "../elements/figures.js";

const STATES = {
  queued: "Getting ready",
  running: "Running",
  done: "Done",
  failed: "Ended early: it can go on",
  interrupted: "Interrupted: it can go on",
  cancelled: "Stopped: it can go on",
};
const PHASES = {
  ready: "the participant is asked to begin",
  interval: "felt now",
  question: "the participant is asked",
  wait: "answered",
  feedback: "the participant is told whether it was right",
  break: "a break: the participant goes on",
  pause: "a pause: you let it go on",
};

export function stateOf({ state, screen }) {
  if (state !== "running") return STATES[state];
  if (screen === null) return STATES.queued;
  return screen.phase === "pause" ? "Paused" : STATES.running;
}

/** How many trials count, and how many were none: their levels are not proposed again. */
export function progressOf({ screen, planned }) {
  if (screen === null) return "";
  const of = planned === null ? "" : ` of ${planned}`;
  const { refused } = screen;
  const lost = refused ? `; ${refused} not presented: the rig cannot render them whole` : "";
  return `${screen.answered}${of} trials answered${lost}`;
}

/** The trial under way; what is played is told to who may calibrate. */
export function trialOf({ screen, task }) {
  if (screen === null) return "";
  const { trial, practice, condition, level, unit, phase, interval, intervals } = screen;
  const which = interval > 0 && intervals > 1 ? `interval ${interval} is ` : "";
  const missed = screen.touched ? "" : " The finger was missed.";
  if (level === null) return `Trial ${trial}: ${which}${PHASES[phase]}.${missed}`;
  const kind = practice ? "practice" : condition;
  const start = task.kind === "adjustment" ? "begins at " : "";
  const told = `${start}${figure(level, 3)} ${unit}`;
  return `Trial ${trial}, ${kind}, ${told}: ${which}${PHASES[phase]}.${missed}`;
}

/** What may be done now. */
export function offersOf({ state, screen }, may) {
  const shows = may && state === "running" && screen !== null;
  const paused = shows && (screen.phase === "pause" || screen.pausing);
  return {
    pause: shows && !paused,
    goOn: paused,
    stop: may && (state === "running" || state === "queued"),
    resume: may && ["interrupted", "failed", "cancelled"].includes(state),
  };
}
