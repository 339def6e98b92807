"""`frictus demo`: a rig, a texture streamed to it, and what the finger feels."""

import multiprocessing
import secrets
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

import frictus
from frictus.messages import RigStatus
from frictus.recordings import texture_of
from frictus.textures import Spectrum
from frictus_hardware import SimulatedConfig
from frictus_hardware.simulated.human import HumanStrokes
from frictus_service.cli.felt import Display, Observer
from frictus_service.cli.options import wants_lines, write_line
from frictus_service.cli.serve import said
from frictus_service.config import Config
from frictus_service.daemon.supervisor import Supervisor
from frictus_service.demonstration.comparison import BandComparison, compare, draw
from frictus_service.demonstration.explorer import Heard, explore, profile_of
from frictus_service.demonstration.stage import START_S, demo_config
from frictus_service.fidelity.preview import JND_DB, NOMINAL_HZ, rms_db
from frictus_service.library import SHIPPED
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
