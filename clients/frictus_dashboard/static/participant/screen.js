/** What the participant sees, of one state: words, buttons and their keys. Pure. */

const FIRST = ["1", "ArrowLeft"];
const SECOND = ["2", "ArrowRight"];
/** By task: answer, label, keys. A response box types its keys. */
const CHOICES = {
  "2afc": [["1", "First", FIRST], ["2", "Second", SECOND]],
  "same-different": [["s", "Same", ["s", ...FIRST]], ["d", "Different", ["d", ...SECOND]]],
  "yes-no": [["y", "Yes", ["y", ...FIRST]], ["n", "No", ["n", ...SECOND]]],
  adjustment: [
    ["-", "Weaker", ["-", "ArrowDown", "ArrowLeft"]],
    ["+", "Stronger", ["+", "ArrowUp", "ArrowRight"]],
    ["=", "Done", ["=", "Enter"]],
  ],
};
const HOW = "Put a finger on the screen and keep it moving from side to side while you feel.";
const LOST = "Your finger was not on the screen, or did not move: this comes again. ";
const ENDED = {
  done: ["Thank you", "That was the last trial. You may take your finger away."],
  cancelled: ["Thank you", "The experiment was ended here. Please wait for the experimenter."],
};
const READER = "This page cannot answer: its token lacks the scope render. Please tell the experimenter.";
const WAITING = ["Please wait", "The experiment will begin here by itself."];
const ABSENT = ["Please wait", "The device is not there at the moment."];
const STOPPED = ["Please wait", "The experiment has been interrupted; nothing is lost."];

/**
 * @param {object|null} job the newest experiment of the rig; null: there is none
 * @param {{connected: boolean, here: boolean, may: boolean}} page whether it hears the service,
 *   the rig is present, and it may answer
 * @returns {{kind: string, title: string, text: string, share: number|null,
 *   buttons: {answer: string, label: string, keys: string[]}[],
 *   number: {low: number, high: number}|null}} `kind`: what it is, for its looks
 */
export function screenOf(job, { connected, here = true, may }) {
  const nothing = { kind: "wait", title: "", text: "", share: null, buttons: [], number: null };
  const told = ([title, text], kind = "wait") => ({ ...nothing, kind, title, text });
  if (!connected) return told(["Please wait", "There is no connection at the moment."], "lost");
  if (job === null) return told(here ? WAITING : ABSENT);
  if (job.state in ENDED) return told(ENDED[job.state], "end");
  if (job.state !== "running" && job.state !== "queued") return told(STOPPED);
  if (job.screen === null) return told(["Please wait", "The experiment is being prepared."]);
  const shown = { ...nothing, ...ofPhase(job.screen, job.task), share: shareOf(job) };
  const asks = shown.buttons.length > 0 || shown.number !== null;
  return may || !asks ? shown : { ...shown, text: READER, buttons: [], number: null };
}

function ofPhase(screen, task) {
  const { phase, interval, intervals, touched, right } = screen;
  const go = (label) => [{ answer: "go", label, keys: ["Enter"] }];
  switch (phase) {
    case "ready":
      return { kind: phase, title: "Are you ready?", text: HOW, buttons: go("Begin") };
    case "interval":
      return { kind: phase, title: intervals > 1 ? String(interval) : "Feel", text: "Keep moving" };
    case "question":
      return {
        kind: phase,
        title: task.question.replaceAll(/ \(\d\)/g, ""), // numbers are a keyboard's
        text: touched ? "" : LOST,
        buttons: (CHOICES[task.kind] ?? []).map(([answer, label, keys]) => ({ answer, label, keys })),
        number: task.kind === "magnitude" ? { low: task.low, high: task.high } : null,
      };
    case "feedback":
      return { kind: phase, title: right ? "Right" : "Not right", text: "" };
    case "break":
      return {
        kind: phase,
        title: "Time for a break",
        text: "Rest your hand. Go on whenever you like.",
        buttons: go("Go on"),
      };
    case "pause":
      return { kind: phase, title: "A short pause", text: "It will go on by itself." };
    default:
      return { kind: "wait", title: "Keep moving", text: "" };
  }
}

/** How much of it is done, 0 to 1; null where that depends on the answers. */
function shareOf({ planned, screen }) {
  return planned === null ? null : Math.min(1, screen.answered / planned);
}

/** The answer that a key gives; null: none. @param {string} key as a KeyboardEvent has it */
export function answerOf(buttons, key) {
  const wanted = key.length === 1 ? key.toLowerCase() : key;
  return buttons.find(({ keys }) => keys.includes(wanted))?.answer ?? null;
}
