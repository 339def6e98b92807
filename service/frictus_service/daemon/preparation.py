"""What a rig does before it is armed: everything compiled once, real-time priority taken.

A real-time thread runs whenever it wants to. Where those of all rigs of a machine together want
most of it, neither the API nor a command answers any more, a stop among them.
"""

import base64
import io
import os
import statistics
import sys
import time
from dataclasses import dataclass
from math import ceil
from pathlib import Path
from typing import Final

import numpy as np
from PIL import Image

from frictus.messages import Excitation, Tone
from frictus.stream import StreamFrame
from frictus.textures import Component, Map, Region, Scene, Spectrum
from frictus_hardware import SimulatedConfig
from frictus_hardware.simulated.human import HumanStrokes
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_service.synthesis.chain import Chain, make_chain
from frictus_service.synthesis.compensability import inverse_of, law_of, placeholder_model
from frictus_service.synthesis.renderer import Playable, Renderer
from frictus_service.synthesis.scene import StreamBudget, compile_excitation, compile_scene

FREE_SHARE: Final = 0.25
"""Of the cores; real-time threads leave it to everything else."""
WHOLE_OVER_LOOP: Final = 2.5
"""What a rig's process takes over what its blocks take: 1.7 measured without readers."""
YOUNG_S: Final = 1.0
"""A thread that has not run so long does not show yet what it takes."""

_REAL_TIME: Final = {"1", "2"}
"""SCHED_FIFO and SCHED_RR, as Linux numbers them."""
_UTIME, _STIME, _START, _POLICY = 11, 12, 19, 38
"""Fields of /proc/PID/task/TID/stat, counted from the one behind the name (proc(5))."""


@dataclass(frozen=True, slots=True)
class RealTimeBudget:
    """What real-time threads may take of this machine, and what they would.

    Attributes
    ----------
    cores : int
        That this process may use.
    others : float
        Cores that the real-time threads of other processes take.
    rig : float
        Cores that this rig takes.
    """

    cores: int
    others: float
    rig: float

    @property
    def accepted(self) -> float:
        """How many cores all real-time threads together may take."""
        return (1.0 - FREE_SHARE) * self.cores

    @property
    def fits(self) -> bool:
        """Whether this rig may have real-time priority."""
        return self.others + self.rig <= self.accepted

    def __str__(self) -> str:
        """Return the sum, what is accepted and what to do."""
        return (
            f"real-time threads would take {self.others + self.rig:.2f} of {self.cores} cores, "
            f"{self.rig:.2f} of them this rig's; at most {self.accepted:.2f} are accepted, so "
            "that the API and commands answer: run fewer rigs on this machine, or lower "
            "sample_rate_hz"
        )


def budget_for(loop: float) -> RealTimeBudget:
    """Return what this machine has for a rig.

    Parameters
    ----------
    loop : float
        Time that the rig's blocks take, over their duration.
    """
    affinity = getattr(os, "sched_getaffinity", None)
    cores = len(affinity(0)) if affinity else os.cpu_count() or 1
    rig = WHOLE_OVER_LOOP * loop
    return RealTimeBudget(cores, taken_by_others(0.5 * rig), rig)


def taken_by_others(young: float, proc: Path = Path("/proc")) -> float:
    """Return how many cores the real-time threads of other processes take.

    Each counts with what it took on average since it began. On a system that does not list
    them, none is known of, and 0 is returned.

    Parameters
    ----------
    young : float
        What a thread counts with that is younger than `YOUNG_S`: two rigs may start at once.
    proc : Path
        Where Linux lists threads.
    """
    if sys.platform == "win32":
        return 0.0
    try:
        now_s = float((proc / "uptime").read_text().split()[0])
    except OSError:
        return 0.0
    tick_s = 1.0 / os.sysconf("SC_CLK_TCK")
    taken = 0.0
    for stat in proc.glob("[0-9]*/task/[0-9]*/stat"):
        if stat.parts[-4] == str(os.getpid()):
            continue
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue  # it has ended meanwhile
        if fields[_POLICY] in _REAL_TIME:
            age_s = now_s - tick_s * int(fields[_START])
            used_s = tick_s * (int(fields[_UTIME]) + int(fields[_STIME]))
            taken += used_s / age_s if age_s >= YOUNG_S else young
    return taken


def raise_priority(priority: int, budget: RealTimeBudget) -> str:
    """Ask for real-time priority for this thread if it fits; return what came of it.

    Not having it is no fault: the loop then is later now and then, which is counted.

    Parameters
    ----------
    priority : int
        1 to 99, of SCHED_FIFO.
    budget : RealTimeBudget
        What the rigs of this machine take.
    """
    if not budget.fits:
        return f"normal: {budget}"
    if sys.platform == "win32" or not hasattr(os, "sched_setscheduler"):
        return "normal (this system has no SCHED_FIFO)"
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except OSError as error:
        return (
            f"normal ({error.strerror}); allow real time by "
            "LimitRTPRIO in the unit file or rtprio in limits.conf"
        )
    return f"real time (SCHED_FIFO {priority})"


EVERY_CORRECTION: Final = (
    ("fractional_rolloff", {"excess_order": 0.1}),
    ("charge_leakage", {"corner_hz": 1.0}),
    ("residual_quadratic", {"share": 0.01}),
    ("extra_resonance", {"depth": 0.1}),
    ("echo", {"share": 0.05}),
)
"""Between them they need every compiled part of the inverse."""
FADE_S = 0.06
"""Long enough for touch reports to come, and for what is next to be faded in."""


def warm_up(sample_rate_hz: float, block_samples: int) -> float:
    """Render whatever can be rendered on a simulated rig that runs as fast as it can.

    Parameters
    ----------
    sample_rate_hz : float
        Samples per second of the device's clock.
    block_samples : int

    Returns
    -------
    float
        Time that a block took, over its duration, once everything was compiled: the median, so
        that what else the machine does hardly enters.
    """
    config = SimulatedConfig(
        clock="virtual", finger=SteadyStrokes(), sample_rate_hz=sample_rate_hz
    )
    law = law_of(placeholder_model())
    screen = config.screen
    scene = compile_scene(_every_kind(), law, screen, sample_rate_hz)
    budget = StreamBudget.open(0.05, law)
    wave = 0.04 * np.sin(2.0 * np.pi * np.arange(64) / 64.0)
    frame = StreamFrame(0, 0, 0, 1, 2.0, True, 0.0, wave.astype(np.float32))
    streamed = budget.compile(frame)
    tone = Excitation(tones=[Tone(hz=100.0, amplitude=0.5)])
    excited = compile_excitation(tone, law, sample_rate_hz)
    coming: tuple[Playable, ...] = (scene, excited, scene, budget.quiet, streamed)
    # Only a human finger has compiled code that is not every other finger's too.
    HumanStrokes().start(config.screen_mm, np.random.default_rng(0)).at(np.zeros(1))
    with config.make() as rig:
        rig.arm()
        chain = make_chain(rig, law, screen, block_samples)
        for playable in coming:
            chain.renderer.set_scene(playable)
            _play(chain, sample_rate_hz, block_samples)
        inverse = inverse_of(law, EVERY_CORRECTION)
        chain.renderer = Renderer(inverse, screen, sample_rate_hz, block_samples, scene)
        _play(chain, sample_rate_hz, block_samples)
        took_s = _play(chain, sample_rate_hz, block_samples)
    return statistics.median(took_s) * sample_rate_hz / block_samples


def _play(chain: Chain, sample_rate_hz: float, block_samples: int) -> list[float]:
    """Turn the loop for `FADE_S`; return how long each block took, s."""
    took_s = []
    for _ in range(ceil(FADE_S * sample_rate_hz / block_samples)):
        begun_s = time.perf_counter()
        chain.step(True)
        took_s.append(time.perf_counter() - begun_s)
    return took_s


def _every_kind() -> Scene:
    components = [
        Component(amplitude_n=0.02, cycles_per_mm=1.0),
        Component(amplitude_n=0.02, hz=100.0),
    ]
    image = io.BytesIO()
    Image.fromarray(np.tile(np.array([0, 255], np.uint8), (16, 8))).save(image, "PNG")
    grey = Map(image_png=base64.b64encode(image.getvalue()).decode(), white_n=0.02)
    return Scene(
        regions=[Region(texture=Spectrum(components=components)), Region(texture=grey)]
    )
