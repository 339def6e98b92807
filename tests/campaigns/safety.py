"""Search the safety machine and measure times to zero: `python -m tests.campaigns.safety`.

Writes the section of the document; takes some minutes, and needs nothing but one core.
"""

from typing import Final

import numpy as np
from tests.campaigns.reliability import OUT, table, with_section
from tests.service.daemon.safety_events import EVENTS, GROUPS
from tests.service.daemon.safety_model import search
from tests.service.daemon.time_to_zero import CAUSES, LIMITS_MS, time_to_zero_ms

PHASES: Final = 4
MOST_STATES: Final = 1_000
"""Of all events together, whose reachable states are too many to visit."""

SEARCH: Final = """\
The real loop, interlock, safety machine, renderer, monitor and output queue, driven on the
smallest device (one block of lead, one of ramp) by every order of these events, each also
while the loop waits for a block, where that makes a difference. An oracle beside it knows
owner, lease, finger and sensors from what was asked and answered. Wrong is: output longer
than a block and the ramp after the owner's right has ended, or than a block, the lead and
the ramp after finger or sensors are gone; a rise steeper than the ramp; output asked of a
disarmed device; a grant while tripped or held by another."""
TIMES: Final = """\
Times from a cause to the last output, over {phases} phases of the finger's stroke: the
simulated rig as it ships, blocks of 5 ms, lead 20 ms, ramp 20 ms, in time of the device. A
lost stream, device or link leaves 0 V when it is known."""
COMMAND: Final = "Made by `uv run python -m tests.campaigns.safety`."


def searched() -> str:
    """Return a table of the searches."""
    rows = []
    for name, events in {**GROUPS, "all, nearest first": EVENTS}.items():
        found = search(events, most_states=MOST_STATES)
        rows.append(
            [
                name,
                str(len(events)),
                str(found.states),
                str(found.transitions),
                "all" if found.complete else "bounded",
                str(len(found.wrong)),
            ]
        )
    return table(["events", "kinds", "states", "transitions", "visited", "wrong"], rows)


def measured() -> str:
    """Return a table of the times to zero."""
    rows = []
    for cause in CAUSES:
        times_ms = [time_to_zero_ms(cause, phase) for phase in range(PHASES)]
        limit_ms = LIMITS_MS.get(cause, 0.0)
        rows.append(
            [cause, f"{limit_ms:g}", f"{np.median(times_ms):.1f}", f"{np.max(times_ms):.1f}"]
        )
    return table(["cause", "its limit, ms", "to zero: median, ms", "longest, ms"], rows)


def main() -> None:
    """Write the section."""
    body = "\n\n".join([SEARCH, searched(), TIMES.format(phases=PHASES), measured(), COMMAND])
    text = OUT.read_text(encoding="utf-8")
    OUT.write_text(with_section(text, "Safety machine", body), encoding="utf-8")


if __name__ == "__main__":
    main()
