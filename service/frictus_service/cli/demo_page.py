"""`frictus demo --page`: a texture under a slow finger, and the page on it, until Ctrl-C."""

import contextlib
import secrets
import tempfile
import threading
import webbrowser
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from frictus.model import FirstOrderSpeedLaw, Model
from frictus_hardware.simulated.config import SimulatedParticipant
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_hardware.simulated.takeover import TakeoverStrokes
from frictus_service.cli.serve import said
from frictus_service.cli.streams.play import scene_of
from frictus_service.config import Config
from frictus_service.demonstration.stage import AS_PLACEHOLDER, demo_config, stage
from frictus_service.library import SHIPPED
from frictus_service.processes import free_port

TEXTURE: Final = "flat"
"""Its bands are as strong as one another."""
GAIN: Final = 0.85
"""What the drive can give without scaling it."""
SLOW_MM_S: Final = 25.0
"""Where the finger-screen response takes most from a texture."""
PARTICIPANT: Final = SimulatedParticipant(gain_n=2.0 * AS_PLACEHOLDER.gain_n)
"""Whose friction is twice what the placeholder of a new rig says."""
AFTER_S: Final = 15.0
"""From the page to the sample study: each takes a core for seconds."""
SAMPLE: Final = "laboratory_next_door.h5"
_tell = said(as_json=False)


def demo_page(seed: int | None) -> None:
    """Play a texture on a simulated rig, and open the page on it, until Ctrl-C.

    Parameters
    ----------
    seed : int or None
        Of the rig and of the sample study; None draws one.
    """
    seed = secrets.randbits(32) if seed is None else seed
    with tempfile.TemporaryDirectory(prefix="frictus-demo-") as folder:
        finger = TakeoverStrokes(strokes=SteadyStrokes(speed_mm_s=SLOW_MM_S))
        config = _config(Path(folder), finger, seed)
        scene = scene_of(str(SHIPPED / f"{TEXTURE}.json"), config.textures, gain=GAIN)
        _tell("starting a router, a simulated rig and the API (the first time takes a minute)")
        sample = threading.Timer(AFTER_S, _sample_study, (config, seed))
        show = partial(_show, config, sample)
        try:
            with contextlib.suppress(KeyboardInterrupt):
                stage(config, scene, _tell, show, threading.Event())
        finally:  # before its folder goes
            sample.cancel()
            if sample.is_alive():
                sample.join()


def _config(folder: Path, finger: TakeoverStrokes, seed: int) -> Config:
    """Return a rig that knows its participant, as after a calibration."""
    config = demo_config(folder, finger, free_port(), seed, PARTICIPANT)
    law = FirstOrderSpeedLaw(
        gain_n=PARTICIPANT.gain_n,
        cutoff_0_hz=PARTICIPANT.cutoff_0_hz,
        slope_hz_per_mm_s=PARTICIPANT.slope_hz_per_mm_s,
    )
    source = {"source": "what the simulation of this participant is made with"}
    model = Model(base=law, participant="virtual", provenance=source)
    path = folder / "participant.json"
    path.write_bytes(model.to_json())
    return config.model_copy(update={"model_file": path})


def _show(config: Config, sample: threading.Timer, url: str) -> None:
    _tell(f"the page: {url}   (Ctrl-C here ends all of it)")
    rig = f"--router {config.router.endpoint} --site {config.site} --rig {config.rig}"
    _tell(f"from another terminal: frictus watch {rig}")
    _tell(
        f"its participant feels {PARTICIPANT.gain_n:g} N at full drive, twice what a new rig's "
        "placeholder says: to find that by a calibration, STOP on the page, then Calibrate"
    )
    if not webbrowser.open(url):
        _tell("no browser could be opened: open that address in one")
    sample.start()


def _sample_study(config: Config, seed: int) -> None:
    from frictus_laboratory.reproduction.sample_study import write_sample_study

    config.studies.mkdir(parents=True, exist_ok=True)
    write_sample_study(config.studies / SAMPLE, np.random.default_rng(seed))
    _tell(
        f"what does its model get wrong? a sample study is on the page, in Discovery: {SAMPLE}"
    )
