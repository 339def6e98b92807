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

from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_hardware.simulated.takeover import TakeoverStrokes
from frictus_service.cli.serve import said
from frictus_service.cli.streams.play import scene_of
from frictus_service.config import Config
from frictus_service.demonstration.stage import demo_config, stage
from frictus_service.library import SHIPPED
from frictus_service.processes import free_port

TEXTURE: Final = "flat"
"""Its bands are as strong as one another."""
GAIN: Final = 0.85
"""What the drive can give without scaling it."""
SLOW_MM_S: Final = 25.0
"""Where the finger-screen response takes most from a texture."""
AFTER_S: Final = 15.0
"""From the page to the sample study: each takes a core for seconds."""
SAMPLE: Final = "laboratory_next_door.h5"
_tell = said(as_json=False)


def demo_page() -> None:
    """Play a texture on a simulated rig, and open the page on it, until Ctrl-C."""
    with tempfile.TemporaryDirectory(prefix="frictus-demo-") as folder:
        finger = TakeoverStrokes(strokes=SteadyStrokes(speed_mm_s=SLOW_MM_S))
        config = demo_config(Path(folder), finger, free_port(), seed=secrets.randbits(32))
        scene = scene_of(str(SHIPPED / f"{TEXTURE}.json"), config.textures, gain=GAIN)
        _tell("starting a router, a simulated rig and the API (the first time takes a minute)")
        sample = threading.Timer(AFTER_S, _sample_study, (config,))
        show = partial(_show, config, sample)
        try:
            with contextlib.suppress(KeyboardInterrupt):
                stage(config, scene, _tell, show, threading.Event())
        finally:  # before its folder goes
            sample.cancel()
            if sample.is_alive():
                sample.join()


def _show(config: Config, sample: threading.Timer, url: str) -> None:
    _tell(f"the page: {url}   (Ctrl-C here ends all of it)")
    rig = f"--router {config.router.endpoint} --site {config.site} --rig {config.rig}"
    _tell(f"from another terminal: frictus watch {rig}")
    _tell("to calibrate its participant: STOP on the page, then Calibrate there or here")
    if not webbrowser.open(url):
        _tell("no browser could be opened: open that address in one")
    sample.start()


def _sample_study(config: Config) -> None:
    from frictus_laboratory.reproduction.sample_study import write_sample_study

    config.studies.mkdir(parents=True, exist_ok=True)
    write_sample_study(config.studies / SAMPLE, np.random.default_rng(secrets.randbits(32)))
    _tell(
        f"what does its model get wrong? a sample study is on the page, in Discovery: {SAMPLE}"
    )
