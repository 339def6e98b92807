/** Names, versions and origins of models, in words and in paths. Pure. */

/** `NAME@VERSION` of a published version. */
export function referenceOf({ name, version }) {
  return `${name}@${version}`;
}

/** Path of a reference below /v1; a name may have two parts. */
export function pathOf(reference) {
  return `/models/${reference.split("/").map(encodeURIComponent).join("/")}`;
}

/** The rig that measured a version, and whether that one is simulated. */
export function measuredOn({ rig, simulated }) {
  return [rig, simulated && "(simulated)"].filter(Boolean).join(" ");
}
