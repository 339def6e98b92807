"""`frictus demo`: a rig, a texture streamed to it, what the finger feels and the rig learns."""

import multiprocessing
import secrets
import sys
import tempfile
import time
import webbrowser
from pathlib import Path
from typing import Any, Final

import numpy as np
from rich.console import Console
from rich.table import Table

import frictus
from frictus.messages import EstimateState, RigStatus
from frictus.recordings import texture_of
from frictus.textures import Spectrum
from frictus_hardware import SimulatedConfig
from frictus_hardware.simulated.human import HumanStrokes
from frictus_service.cli.options import wants_lines, write_line
from frictus_service.cli.serve import said
from frictus_service.cli.streams.felt import Display, Observer
from frictus_service.cli.streams.track import line_of
from frictus_service.config import Config
from frictus_service.daemon.processes.supervisor import Supervisor
from frictus_service.demonstration.comparison import BandComparison, compare, draw
from frictus_service.demonstration.explorer import Heard, explore, profile_of
from frictus_service.demonstration.learning import Learned, learn, learning_config, same_strokes
from frictus_service.demonstration.stage import START_S, demo_config
from frictus_service.fidelity.preview import JND_DB, NOMINAL_HZ, error_db, rms_db
from frictus_service.library import SHIPPED
from frictus_service.processes import free_port
from frictus_service.synthesis.compensability import law_of

TEXTURE = "paper"
LOOK_S = 0.1
_tell = said(as_json=False)


def demo(as_json: bool, plot: Path | None, seconds: float, seed: int | None) -> None:
    """Run the demo.

    Parameters
    ----------
    as_json : bool
        Print one JSON object at the end and nothing else.
    plot : Path or None
        Where to leave the picture.
    seconds : float
        How long the finger explores.
    seed : int or None
        Of the finger's way; None draws one, so that what is shown is not one lucky way.
    """
    seed = secrets.randbits(32) if seed is None else seed
    texture = texture_of((SHIPPED / f"{TEXTURE}.json").read_text(encoding="utf-8"))
    assert isinstance(texture, Spectrum)
    with tempfile.TemporaryDirectory(prefix="frictus-demo-") as folder:
        config = demo_config(Path(folder), HumanStrokes(), port=0, seed=seed)
        _tell("starting a router, a simulated rig and the API (the first time takes a minute)")
        with Supervisor(config, say=_tell) as supervisor:
            supervisor.wait_ready(START_S)
            _tell(
                f"a separate process streams '{TEXTURE}', fitted to a recording, "
                f"to a finger that explores for {seconds:g} s"
            )
            heard, status, law = _explore(config, texture, seconds, as_json)
    comparison = compare(heard, profile_of(texture), law, _backend(config))
    if plot is not None:
        felt = {"felt": comparison.compensated, "not compensated": comparison.uncompensated}
        draw(
            comparison.target,
            felt,
            f"'{TEXTURE}' under a freely moving finger (simulated rig)",
            plot,
        )
    if as_json:
        write_line(**_summary(heard, status, comparison, seed))
    elif wants_lines(as_json):
        write_line(event="summary", **_summary(heard, status, comparison, seed))
    else:
        _print(heard, status, comparison, plot)


def _backend(config: Config) -> SimulatedConfig:
    assert isinstance(config.backend, SimulatedConfig)
    return config.backend


def _explore(
    config: Config, texture: Spectrum, seconds: float, silent: bool
) -> tuple[Heard, RigStatus, Any]:
    """Let the client process stream, and show what the rig publishes meanwhile."""
    router = config.router.endpoint
    context = multiprocessing.get_context("spawn")
    told, telling = context.Pipe(duplex=False)
    explorer = context.Process(
        target=explore,
        args=(router, config.site, config.rig, texture, seconds, telling),
        name="frictus-demo-explorer",
    )
    with frictus.connect(router, "demo-viewer") as client:
        rig = client.rig(config.rig, config.site)
        observer = Observer(rig)
        explorer.start()
        telling.close()  # so that the explorer's end shows as the end of the pipe
        begun_s = time.monotonic()
        if silent:
            heard = told.recv()
        else:
            lines = wants_lines(as_json=False)
            with Display(f"'{TEXTURE}', felt by a simulated finger", lines) as display:
                while not told.poll(LOOK_S):
                    display.show(observer.look(), time.monotonic() - begun_s)
                heard = told.recv()
        explorer.join()
        if not isinstance(heard, Heard):
            raise RuntimeError(f"the exploring client failed: {heard}")
        return heard, rig.status(), law_of(rig.model().model)


def _summary(
    heard: Heard, status: RigStatus, comparison: BandComparison, seed: int
) -> dict[str, Any]:
    """Return what `--json` prints."""
    felt, bare = comparison.compensated_db, comparison.uncompensated_db
    latency = heard.latency_ms
    return {
        "texture": TEXTURE,
        "simulated": True,
        "seed": seed,
        "model_placeholder": status.model_placeholder,
        "applied_gain": heard.applied.gain,
        "band_hz": list(NOMINAL_HZ),
        "error_db": {"compensated": _finite(felt), "uncompensated": _finite(bare)},
        "overall_error_db": {"compensated": rms_db(felt), "uncompensated": rms_db(bare)},
        "loop_lateness_ms": {
            "p50": status.timing.lateness_p50_ms,
            "p99": status.timing.lateness_p99_ms,
            "max": status.timing.lateness_max_ms,
        },
        "underruns": status.counters.underruns,
        "overruns": status.counters.overruns,
        "deadline_misses": status.counters.deadline_misses,
        "clipped_samples": status.counters.clipped_samples,
        "extrapolated_samples": status.counters.extrapolated_samples,
        "blocks_published": status.counters.blocks_published,
        "blocks_received": heard.received,
        "blocks_lost": heard.lost,
        "texture_update_latency_ms": {
            "median": float(np.median(latency)) if latency else None,
            "max": max(latency, default=None),
            "updates": len(latency),
            "of_which_lead": status.lead_ms,
        },
    }


def _finite(values: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> list[float | None]:
    return [float(value) if np.isfinite(value) else None for value in values]


def _print(
    heard: Heard, status: RigStatus, comparison: BandComparison, plot: Path | None
) -> None:
    felt, bare = comparison.compensated_db, comparison.uncompensated_db
    table = Table(title="error of the friction felt, dB", title_justify="left")
    for heading in ("band, Hz", "compensated", "not compensated"):
        table.add_column(heading, justify="right")
    for centre, one, other in zip(NOMINAL_HZ, felt, bare, strict=True):
        table.add_row(f"{centre:g}", _shown(one), _shown(other))
    table.add_section()
    table.add_row("all, rms", f"{rms_db(felt):.2f}", f"{rms_db(bare):.2f}")
    console = Console()
    console.print(table)
    late, counts, latency = status.timing, status.counters, heard.latency_ms
    console.print(
        f"difference threshold {JND_DB} dB; applied gain {heard.applied.gain:.2f}; "
        "simulated rig, population model that nobody measured\n"
        f"loop late p50 {late.lateness_p50_ms:.2f}, p99 {late.lateness_p99_ms:.2f}, "
        f"max {late.lateness_max_ms:.2f} ms; {counts.underruns} underruns, "
        f"{counts.overruns} overruns\n"
        f"blocks: {counts.blocks_published} published, {sum(heard.received.values())} received "
        f"while exploring, {sum(heard.lost.values())} lost"
    )
    if latency:
        console.print(
            f"texture update, sent to first changed sample at the DAC: median "
            f"{np.median(latency):.1f}, max {max(latency):.1f} ms of {len(latency)} "
            f"({status.lead_ms:g} ms of it is the rig's lead)"
        )
    if plot is not None:
        console.print(f"picture: {plot}")
    console.print("to see it live, and to switch compensation off: frictus demo --page")


def _shown(error_db: float) -> str:
    return f"{error_db:+.2f}" if np.isfinite(error_db) else "too weak"


LEARNED_TEXTURE: Final = "flat"
"""Its bands are as strong as one another."""


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
    texture = texture_of((SHIPPED / f"{LEARNED_TEXTURE}.json").read_text(encoding="utf-8"))
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
        _tell(f"'{LEARNED_TEXTURE}' under a finger that the placeholder model does not fit")
        learned = learn(config, texture, seconds, _tell, show, look)
    _tell("the same strokes once more, by the model of the beginning and by that of the end")
    laws = {"placeholder": law_of(learned.before), "learned": law_of(learned.after)}
    target, felt = same_strokes(config, texture, seconds, laws)
    if plot is not None:
        title = (
            f"'{LEARNED_TEXTURE}' under a finger that the placeholder does not fit "
            "(simulated rig)"
        )
        draw(target, felt, title, plot)
    summary = _learned_summary(
        learned, seed, {n: rms_db(error_db(p, target)) for n, p in felt.items()}
    )
    if lines:
        write_line(event="summary", **summary)
    else:
        _print_learned(learned, target, felt, plot)


def _learned_summary(
    learned: Learned, seed: int, overall_db: dict[str, float]
) -> dict[str, Any]:
    state = learned.state
    return {
        "texture": LEARNED_TEXTURE,
        "simulated": True,
        "seed": seed,
        "first_change_s": learned.first_change_s if state.changes else None,
        "changes": [change.model_dump(mode="json") for change in state.changes],
        "law": None if state.law is None else state.law.model_dump(mode="json"),
        "same_strokes_error_db": overall_db,
    }


def _print_learned(
    learned: Learned, target: Any, felt: dict[str, Any], plot: Path | None
) -> None:
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
