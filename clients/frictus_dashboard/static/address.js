/** What stands behind the `#` in the address: a view, a rig, and what the view makes of the rest. */

/** Names as they stand in the address, `#/textures/rig1`, and on the page. */
export const VIEWS = {
  live: "Live",
  "live-model": "Live model",
  textures: "Textures",
  calibrate: "Calibrate",
  experiment: "Experiment",
  models: "Models",
  discovery: "Discovery",
  participant: "Participant",
};
/** What is in front of a participant leads nowhere else, and nothing leads to it by chance. */
export const ALONE = "participant";

const RIG = /^[A-Za-z0-9._-]{1,64}$/;

/** Whether a rig can be called so; a name that was typed by hand may be anything, or null. */
export function isRigName(name) {
  return name !== null && RIG.test(name);
}

/** The address of a view of a rig; null: of the first that is present. */
export function address(view, rig, ...rest) {
  const words = rig === null ? [view] : [view, rig, ...rest];
  return `#/${words.map(encodeURIComponent).join("/")}`;
}

/** The view, the rig or null, and the rest that an address names; what it does not say is live. */
export function route(hash) {
  let words = [];
  try {
    words = hash.slice(2).split("/").map(decodeURIComponent);
  } catch (error) {
    if (!(error instanceof URIError)) throw error; // typed by hand: the live view comes up
  }
  const [view, rig, ...rest] = words;
  return { view: Object.hasOwn(VIEWS, view) ? view : "live", rig: rig || null, rest };
}
