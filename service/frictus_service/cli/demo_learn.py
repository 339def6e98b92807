"""`frictus demo --learn`: a finger twice as fast as the model, learned while it explores."""

import secrets
import sys
import tempfile
import webbrowser
from pathlib import Path
from typing import Any, Final

from rich.console import Console
from rich.table import Table

from frictus.messages import EstimateState
from frictus.recordings import texture_of
from frictus.textures import Spectrum
from frictus_service.cli.options import wants_lines, write_line
from frictus_service.cli.serve import said
from frictus_service.cli.track import line_of
from frictus_service.demonstration.comparison import draw
from frictus_service.demonstration.learning import (
    Learned,
    learn,
    learning_config,
    same_strokes,
)
from frictus_service.fidelity.preview import JND_DB, NOMINAL_HZ, error_db, rms_db
from frictus_service.library import SHIPPED
from frictus_service.processes import free_port
from frictus_service.synthesis.compensability import law_of

TEXTURE: Final = "flat"
"""Its bands are as strong as one another."""
_tell = said(as_json=False)


def demo_learn(
    as_json: bool, plot: Path | None, seconds: float, seed: int | None, page: bool
) -> None:
    """Run the demo.

    Parameters
    ----------
    as_json : bool
        Print JSON lines and nothing else.
    plot : Path or None
        Where to leave the picture.
    seconds : float
        How long the finger explores.
    seed : int or None
        Of the finger's way; None draws one.
    page : bool
        Whether to open the page on it.
    """
    seed = secrets.randbits(32) if seed is None else seed
    lines = wants_lines(as_json)
    texture = texture_of((SHIPPED / f"{TEXTURE}.json").read_text(encoding="utf-8"))
    assert isinstance(texture, Spectrum)

    def look(at_s: float, state: EstimateState) -> None:
        if lines:
            write_line(
                event="estimate",
                at_s=round(at_s, 1),
                error_db=state.error_db,
                changes=len(state.changes),
                held_back=state.held_back,
            )
        else:
            sys.stdout.write(f"{at_s:5.1f} s  {line_of(state)}\n")
            sys.stdout.flush()

    def show(url: str) -> None:
        _tell(f"the page: {url}")
        if page and not webbrowser.open(url):
            _tell("no browser could be opened: open that address in one")

    with tempfile.TemporaryDirectory(prefix="frictus-demo-") as folder:
        config = learning_config(Path(folder), free_port(), seed)
        _tell("starting a router, a simulated rig, its tracker and the API")
        _tell(f"'{TEXTURE}' under a finger that the placeholder model does not fit")
        learned = learn(config, texture, seconds, _tell, show, look)
    _tell("the same strokes once more, by the model of the beginning and by that of the end")
    laws = {"placeholder": law_of(learned.before), "learned": law_of(learned.after)}
    target, felt = same_strokes(config, texture, seconds, laws)
    if plot is not None:
        title = f"'{TEXTURE}' under a finger that the placeholder does not fit (simulated rig)"
        draw(target, felt, title, plot)
    summary = _summary(learned, seed, {n: rms_db(error_db(p, target)) for n, p in felt.items()})
    if lines:
        write_line(event="summary", **summary)
    else:
        _print(learned, target, felt, plot)


def _summary(learned: Learned, seed: int, overall_db: dict[str, float]) -> dict[str, Any]:
    state = learned.state
    return {
        "texture": TEXTURE,
        "simulated": True,
        "seed": seed,
        "first_change_s": learned.first_change_s if state.changes else None,
        "changes": [change.model_dump(mode="json") for change in state.changes],
        "law": None if state.law is None else state.law.model_dump(mode="json"),
        "same_strokes_error_db": overall_db,
    }


def _print(learned: Learned, target: Any, felt: dict[str, Any], plot: Path | None) -> None:
    table = Table(title="error of the friction felt on the same strokes, dB")
    for heading in ("band, Hz", *felt):
        table.add_column(heading, justify="right")
    errors = [error_db(power, target) for power in felt.values()]
    for centre, *off in zip(NOMINAL_HZ, *errors, strict=True):
        shown = [f"{one:+.2f}" if one == one else "too weak" for one in off]
        table.add_row(f"{centre:g}", *shown)
    table.add_section()
    table.add_row("all, rms", *(f"{rms_db(off):.2f}" for off in errors))
    console = Console()
    console.print(table)
    changes = len(learned.state.changes)
    when = f", the first after {learned.first_change_s:.1f} s" if changes else ""
    console.print(
        f"difference threshold {JND_DB} dB; the model was changed {changes} times{when}; "
        "simulated rig and finger"
    )
    if plot is not None:
        console.print(f"picture: {plot}")
