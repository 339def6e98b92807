/** What a tracker may do with a rig's model, in words. Pure. */

/** The policies with what each does, as the switch shows them. */
export const POLICIES = {
  observe: { title: "Observe", does: "Learns the finger and judges the model; changes nothing." },
  suggest: { title: "Suggest", does: "Says here how the model should change; changes nothing." },
  adapt: { title: "Adapt", does: "Has gain and cutoff follow the finger while it plays." },
};

/** Of a rig; one of an older version has none and observes. */
export function policyOf(status) {
  return status?.adaptation ?? "observe";
}

/** What a viewer of any view must know, as the text of a badge; empty where nothing adapts. */
export function followed(status) {
  const count = status?.adaptations ?? 0;
  const times = count === 1 ? "once" : `${count} times`;
  if (policyOf(status) === "adapt") {
    const sofar = count === 0 ? "not changed yet" : `changed ${times}`;
    return `Adapts: the model follows the finger, ${sofar}`;
  }
  return count === 0 ? "" : `Adapted: the model has followed the finger ${times}`;
}
