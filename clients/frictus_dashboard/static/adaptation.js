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
export function adapting(status) {
  if (policyOf(status) !== "adapt") return "";
  const count = status.adaptations ?? 0;
  const times = count === 1 ? "once" : `${count} times`;
  const sofar = count === 0 ? "not yet" : times;
  return `Adapts: the model follows the finger while it plays, changed ${sofar} since it was set`;
}
