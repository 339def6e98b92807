/** What a rig's recorder does, in words, and what can be asked of it. Pure. */

/** A recorder that records says so every second: longer without a word, it may be gone. */
const SILENT_MS = 5_000;

/**
 * @param {object} heard
 * @param {string} heard.rig
 * @param {object|null} heard.recording the newest RecordingState; null: none was heard
 * @param {number} heard.ageMs since it changed last
 * @param {boolean} heard.trusted whether the rig is there and speaks
 * @param {boolean} heard.may whether the page's token lets it record
 * @returns {{kind: string, text: string, start: boolean, end: boolean}} `start`, `end`: offered
 */
export function recordStateOf({ rig, recording, ageMs, trusted, may }) {
  const none = { start: false, end: false };
  if (recording === null) return { ...none, kind: "none", text: `No recorder runs at ${rig}.` };
  const { recording: runs, name, problem } = recording;
  if (!runs) {
    const last = name === null ? "" : ended(recording);
    const text = problem === null ? last : `${last} ${problem}`.trim();
    return { ...none, kind: problem === null ? "idle" : "bad", text, start: may && trusted };
  }
  const soFar = `${name}: ${figures(recording)}`;
  if (ageMs > SILENT_MS) {
    const ago = `no word from the recorder for ${Math.floor(ageMs / 1e3)} s`;
    return { ...none, kind: "unknown", text: `${soFar}; ${ago}`, end: may };
  }
  const kind = recording.lost_blocks > 0 ? "lossy" : "runs";
  return { ...none, kind, text: `Recording ${soFar}`, end: may };
}

function ended(recording) {
  if (recording.bytes_written === 0) return `The last one: ${recording.name}.`;
  return `The last one, ${recording.name}: ${figures(recording)}.`;
}

function figures({ seconds, bytes_written: bytes, lost_blocks: lost }) {
  const losses = lost === 0 ? "nothing lost" : `${lost} ${lost === 1 ? "block" : "blocks"} lost`;
  return `${length(seconds)}, ${size(bytes)}, ${losses}`;
}

/** A length as minutes and seconds. */
export function length(seconds) {
  if (seconds === null) return "–";
  if (seconds < 60) return `${seconds.toFixed(1)} s`;
  const whole = Math.floor(seconds);
  return `${Math.floor(whole / 60)} min ${String(whole % 60).padStart(2, "0")} s`;
}

/** A number of bytes in the unit that suits it. */
export function size(bytes) {
  const units = ["B", "kB", "MB", "GB"];
  let value = bytes;
  while (value >= 1_000 && units.length > 1) {
    value /= 1_000;
    units.shift();
  }
  return `${units[0] === "B" ? value : value.toFixed(value < 10 ? 2 : 1)} ${units[0]}`;
}

/** A name that sorts by time: the rig, and the local date and time. @param {Date} now */
export function freshName(rig, now) {
  const two = (value) => String(value).padStart(2, "0");
  const date = [now.getFullYear(), now.getMonth() + 1, now.getDate()].map(two).join("");
  const time = [now.getHours(), now.getMinutes(), now.getSeconds()].map(two).join("");
  return `${rig}-${date}-${time}`.slice(-100);
}
