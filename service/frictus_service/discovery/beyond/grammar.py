"""The grammar of forms: what is tried where no cause explains, in which family, in which words.

The equations stand in `frictus_hardware.physics.forms`, under the same ids.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Final

import numpy as np

from frictus_hardware.physics.effects import FORMS
from frictus_hardware.physics.forms import WIDTHS
from frictus_service.discovery.problem.candidates import Candidate

Held = tuple[tuple[str, float], ...]


@dataclass(frozen=True, slots=True)
class Form:
    """A form, and where its shape is looked for.

    Attributes
    ----------
    id : str
        Of its effect.
    family : str
        Forms of one family differ in detail only: resonances by what their strength follows.
    grid : tuple of held values
        Shapes at which the form is tried.
    shapes : tuple of str
        Parameters that are fitted besides the dose.
    what : str
        The form in words; parameters in braces.
    could_be : str
        What has such a form.
    told_by : str
        The experiment that tells which.
    shape_of : frozenset of str
        The causes of the catalogue of which it may be another shape.
    """

    id: str
    family: str
    grid: tuple[Held, ...]
    shapes: tuple[str, ...]
    what: str
    could_be: str
    told_by: str
    shape_of: frozenset[str] = frozenset()

    @property
    def dose(self) -> str:
        """Name of its first parameter."""
        return FORMS[self.id].parameters[0].name

    def candidates(self) -> list[Candidate]:
        """Return the form at each shape of its grid."""
        step = FORMS[self.id].parameters[0].step
        return [Candidate(self.id, self.dose, step, held) for held in self.grid]


@dataclass(frozen=True, slots=True)
class _Words:
    what: str
    could_be: str
    told_by: str


_WORDS: Final[Mapping[str, _Words]] = {
    "extra_resonance": _Words(
        "{kind} at {frequency_hz} Hz, damping {damping}, depth {depth}{following}",
        "a mode of the fingertip, of the screen or of what holds it, or a passive absorber",
        "a hammer test of the screen (`frictus mount`) and another finger or stylus: what "
        "stays with the screen is the rig's; tones a few hertz apart around it",
    ),
    "echo": _Words(
        "an echo {delay_s} s late, share {share}{following}",
        "a wave that comes back from the edge of the screen, or a second path of the drive",
        "the finger at other distances from the edge: the delay of a wave follows; tones "
        "spaced by a quarter of the comb",
    ),
    "pole_zero_pair": _Words(
        "a second time constant, corner at {corner_hz} Hz, share {share}{following}",
        "two layers of skin, or an amplifier or screen that follows the drive in two ways",
        "a dummy load in place of the finger: what stays is electrical; tones an octave around "
        "the corner",
    ),
    "switch_by_speed": _Words(
        "the {part} changes by a factor of {log_change} beyond {threshold_mm_s} mm/s, over "
        "{width_mm_s} mm/s",
        "a change of regime of sliding, or a limit of the tracker",
        "speeds in small steps around the threshold, rising and falling",
    ),
    "switch_by_force": _Words(
        "the {part} changes by a factor of {log_change} beyond {threshold_n} N, over "
        "{width_n} N",
        "contact that is lost below a force, or that saturates beyond it",
        "forces in small steps around the threshold, and the contact area filmed",
    ),
    "switch_by_time": _Words(
        "the {part} changes by a factor of {log_change} {threshold_min} min into the session",
        "something that was changed: cable, amplifier, mount, screen wiped, finger washed; or "
        "a drift that soon levels off",
        "the log of the session at that time, and the first trials repeated at the end",
    ),
    "knee_above_speed": _Words(
        "the {part} follows the speed above {threshold_mm_s} mm/s only, exponent {exponent}, "
        "bending within {softness} of its logarithm",
        "a regime of sliding that begins there, such as contact that lifts",
        "three speeds beyond the threshold",
    ),
    "knee_below_speed": _Words(
        "the {part} follows the speed below {threshold_mm_s} mm/s only, exponent {exponent}, "
        "bending within {softness} of its logarithm",
        "adhesion or sweat, that matter while the finger is slow",
        "three speeds below the threshold, on a dry and on a wiped screen",
    ),
    "knee_above_force": _Words(
        "the {part} follows the force above {threshold_n} N only, exponent {exponent}, "
        "bending within {softness} of its logarithm",
        "a fingertip that flattens no further: its area of contact saturates",
        "three forces beyond the threshold, and the contact area filmed",
    ),
    "knee_below_force": _Words(
        "the {part} follows the force below {threshold_n} N only, exponent {exponent}, "
        "bending within {softness} of its logarithm",
        "contact that is lost in part when the finger presses lightly",
        "three forces below the threshold, and the contact area filmed",
    ),
    "coupling_of_speed_and_force": _Words(
        "the {part} follows the product of log speed and log force, exponent {exponent}",
        "a contact whose area depends on how fast the finger slides",
        "all speeds at all forces, in random order",
    ),
}

_PATHS_OF: Final[Mapping[str, frozenset[str]]] = {
    "extra_resonance": frozenset({"mount_resonance_shift"}),
    "echo": frozenset({"channel_delay"}),
    "pole_zero_pair": frozenset({"charge_leakage", "fractional_rolloff"}),
}
_BENT: Final[Mapping[tuple[str, str], str]] = {
    ("gain", "speed"): "speed_dependent_gain",
    ("gain", "force"): "force_dependent_gain",
    ("gain", "time"): "gain_drift",
    ("cutoff", "speed"): "speed_dependent_cutoff",
    ("cutoff", "force"): "force_dependent_cutoff",
    ("cutoff", "time"): "cutoff_drift",
}
BENT: Final = frozenset(_BENT.values())
"""Causes that the grammar bends: they leave little of a shape that is not theirs."""

_FREQUENCIES: Final = np.geomspace(30.0, 1900.0, 22)
_FOLLOWING: Final[tuple[tuple[str, Held], ...]] = (
    ("", ()),
    ("by_speed", (("by_speed", 1.0),)),
    ("by_force", (("by_force", 1.0),)),
)
_THRESHOLDS: Final[Mapping[str, Sequence[float]]] = {
    "speed": np.arange(25.0, 100.0, 5.0).tolist(),
    "force": np.arange(0.225, 0.6, 0.025).tolist(),
}
TIMES_MIN: Final = tuple(np.arange(1.0, 20.0, 0.5).tolist())
"""At which a step is looked for in a session of which nothing is known."""

_RISES: Final[Mapping[str, float]] = {
    "width_mm_s": WIDTHS["speed"],
    "width_n": WIDTHS["force"],
    "softness": 0.1,
}
"""From which the sharpness of a switch and of a knee is fitted: no finger changes on an edge,
and where a threshold is depends on how sharp it is."""


def grammar(
    times_min: Sequence[float] = TIMES_MIN, step_min: float = WIDTHS["time"]
) -> tuple[Form, ...]:
    """Return all forms.

    Parameters
    ----------
    times_min : sequence of float
        At which a step in time is looked for.
    step_min : float
        Over which it turns.
    """
    thresholds = {**_THRESHOLDS, "time": times_min}
    rises = {**_RISES, "width_min": step_min}
    return tuple(_paths()) + tuple(_scheduled(thresholds, rises))


def _paths() -> Iterator[Form]:
    shapes: dict[str, list[Held]] = {
        "extra_resonance": [
            (("frequency_hz", float(f)), ("damping", d))
            for f, d in product(_FREQUENCIES, (0.05, 0.2))
        ],
        "echo": [(("delay_s", float(d)),) for d in np.geomspace(2e-4, 6e-3, 28)],
        "pole_zero_pair": [(("corner_hz", float(f)),) for f in np.geomspace(20.0, 3000.0, 11)],
    }
    for id_, grid in shapes.items():
        words = _WORDS[id_]
        for follows, held in _FOLLOWING:
            yield Form(
                id=id_,
                family=id_,
                grid=tuple((*each, *held) for each in grid),
                shapes=(*(name for name, _ in grid[0]), *([follows] if follows else [])),
                what=words.what,
                could_be=words.could_be,
                told_by=words.told_by,
                shape_of=_PATHS_OF[id_],
            )


def _scheduled(
    thresholds: Mapping[str, Sequence[float]], rises: Mapping[str, float]
) -> Iterator[Form]:
    for id_, effect in FORMS.items():
        part, _, rest = id_.partition("_")
        if part not in ("gain", "cutoff"):
            continue
        words = _WORDS[rest]
        by = rest.rpartition("_")[2]
        shapes = tuple(each.name for each in effect.parameters[1:])
        coupled = not shapes
        grid: tuple[Held, ...] = ((),)
        if not coupled:
            rise = tuple((name, rises[name]) for name in shapes[1:])
            grid = tuple(((shapes[0], float(at)), *rise) for at in thresholds[by])
        if by == "time":  # what is changed between two trials changes at once
            shapes = shapes[:1]
        yield Form(
            id=id_,
            family=f"{part} by speed and force" if coupled else f"{part} bends by {by}",
            grid=grid,
            shapes=shapes,
            what=words.what.replace("{part}", part),
            could_be=words.could_be,
            told_by=words.told_by,
            shape_of=frozenset() if coupled else frozenset({_BENT[part, by]}),
        )
