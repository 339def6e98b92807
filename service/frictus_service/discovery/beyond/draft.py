"""A draft of a cause from a characterised form: for a person to read, edit and test."""

import json
import re
from pathlib import Path
from textwrap import wrap
from typing import Final

from frictus_hardware.physics.effects import KNOWN
from frictus_service.discovery.catalogue.causes import CAUSES
from frictus_service.discovery.document import Discovery
from frictus_service.errors import DraftCauseError

NAME: Final = re.compile(r"[a-z][a-z0-9_]{2,39}")


def check_name(name: str) -> None:
    """Refuse a name that no new cause can have.

    Raises
    ------
    DraftCauseError
        If it is no identifier in lower case, or known already.
    """
    if not NAME.fullmatch(name):
        raise DraftCauseError(
            f"no cause can be called {name[:60]!r}; accepted: 3 to 40 of a to z, 0 to 9 and _, "
            "a letter first, such as tape_resonance"
        )
    if name in KNOWN or name in CAUSES:
        raise DraftCauseError(f"{name!r} is known already; give the draft another name")


def draft_cause(found: Discovery, name: str) -> dict[Path, str]:
    """Return effect and cause as Python sources, by their paths in the repository.

    The shape is what was found and the dose is free, so that the next study is a test that the
    draft can fail.

    Parameters
    ----------
    found : Discovery
        With a characterised form.
    name : str
        Of the new cause.

    Raises
    ------
    DraftCauseError
        If the name cannot be given, or nothing was characterised.
    """
    check_name(name)
    if not found.characterised:
        raise DraftCauseError(
            "nothing was characterised, so there is no cause to draft; the verdict is "
            f"{found.verdict or 'that nothing could be tested'}"
        )
    form = found.characterised[0]
    dose = KNOWN[form.id].parameters[0].name
    shape = {key: each.value for key, each in form.parameters.items() if key != dose}
    effect = _EFFECT.format(
        name=name, form=form.id, statement=_text(form.statement, 4), shape=_literal(shape)
    )
    cause = _CAUSE.format(
        name=name,
        statement=_text(form.statement, 12),
        literature=_text(f"Draft, unconfirmed: a study of SHA-256 {found.study.sha256}.", 12),
        told_by=_text(f"Draft. Would be told by {form.told_by}.", 12),
    )
    effects = Path("hardware/frictus_hardware/physics/effects")
    causes = Path("service/frictus_service/discovery/catalogue/causes")
    return {effects / f"{name}.py": effect, causes / f"{name}.py": cause}


def _text(text: str, indent: int) -> str:
    """Return a text as Python strings, one after the other on lines of their own."""
    lines = wrap(text, 80 - indent)
    ends = [" " * (place < len(lines) - 1) for place in range(len(lines))]
    return "\n".join(
        " " * indent + json.dumps(line + end, ensure_ascii=False)
        for line, end in zip(lines, ends, strict=True)
    )


def _literal(shape: dict[str, float]) -> str:
    return "".join(f"    {key!r}: {float(value)!r},\n" for key, value in shape.items())


_EFFECT: Final = '''"""Draft of an effect from a discovery: read, edit and test it."""

from dataclasses import replace

from frictus_hardware.physics.effect import Values
from frictus_hardware.physics.forms import FORMS
from frictus_hardware.physics.simulator import Simulator

FORM = FORMS["{form}"]
SHAPE = {{
{shape}}}
"""As it was found; only the dose is free."""

SAID = (
{statement}
)
"""Write the equation here."""


def _apply(simulator: Simulator, values: Values) -> Simulator:
    return FORM.extend(simulator, {{**SHAPE, **values}})


EFFECTS = (
    replace(
        FORM,
        id="{name}",
        equation=SAID,
        parameters=FORM.parameters[:1],
        apply=_apply,
    ),
)
'''

_CAUSE: Final = '''"""Draft of a cause from a discovery: read, edit and test it."""

from frictus_service.discovery.catalogue.cause import Cause

CAUSES = (
    Cause(
        id="{name}",
        response="friction",
        statement=(
{statement}
        ),
        literature=(
{literature}
        ),
        confusable=(),
        next_experiment=(
{told_by}
        ),
        visible_with="Draft: the tones and conditions in which it was found.",
    ),
)
'''
