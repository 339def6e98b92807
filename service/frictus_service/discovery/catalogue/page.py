"""The catalogue as a document: every cause with equation, parameters and experiments."""

from typing import Final

from frictus_hardware.physics.effects import EFFECTS, Parameter
from frictus_service.discovery.catalogue.cause import NO_UNIT, title
from frictus_service.discovery.catalogue.causes import CAUSES, confusable_with

_RESPONSES: Final = {
    "friction": "In the friction response",
    "mobility": "In the skin's mobility",
    "both": "In either",
}
_SCOPES: Final = {
    "participant": "each participant's own",
    "instrument": "the rig's, the same for all",
}
_HEAD: Final = """# Causes

Made by `uv run python bench/causes.py --out docs/causes.md`; do not edit.

What `frictus discover` (`discover.md`) can name. Each cause is an `Effect` in
`frictus_hardware/physics/effects/`, its equation, with which the twin simulates, and a `Cause`
of the same id in `frictus_service/discovery/catalogue/causes/`, its words. To add one is to add
both.

In the equations: g gain, c cutoff, w0 = 2 pi c, v speed, F normal force, x position, m drive
fraction, s = j w. Every effect is null where its first parameter is 0. "The paper" is
Balasubramanian, Pool and Vardar, *Sliding Speed Influences Electrovibration-Induced Finger
Friction Dynamics on Touchscreens*.
"""


def catalogue() -> str:
    """Return the catalogue in Markdown."""
    parts = [_HEAD]
    for response, heading in _RESPONSES.items():
        ids = [id_ for id_, effect in EFFECTS.items() if effect.response == response]
        parts += [f"## {heading}\n", *(_entry(id_) for id_ in ids)]
    return "\n".join(parts)


def _entry(id_: str) -> str:
    cause, effect = CAUSES[id_], EFFECTS[id_]
    lines = [
        f"### {title(id_).capitalize()}",
        cause.statement,
        f"- **`{id_}`**: {effect.equation.replace('``', '`')} "
        f"Parameters are {_SCOPES[effect.scope]}: "
        f"{'; '.join(_range(parameter) for parameter in effect.parameters)}.",
        f"- **Literature**: {cause.literature}",
        f"- **A design needs**: {cause.visible_with}",
        f"- **Firmer by**: {cause.next_experiment}",
        *(
            f"- **Not {title(other)}**: {experiment}"
            for other, experiment in sorted(confusable_with(id_).items())
        ),
    ]
    return "\n".join([lines[0], "", lines[1], "", *lines[2:], ""])


def _range(parameter: Parameter) -> str:
    unit = f" {parameter.unit}" if parameter.unit != NO_UNIT else ""
    return f"`{parameter.name}`, {parameter.low:g} to {parameter.high:g}{unit}"
