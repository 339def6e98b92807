"""How long it takes until a touch report changes what an NI device puts out."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from tests.hardware.nidaq.bench import conversion, loop_back, wiring
from tests.hardware.nidaq.fake_device import FakeDevice
from tests.hardware.nidaq.fake_server import FakeServer

from frictus.textures import Component, Region, Scene, Spectrum
from frictus_hardware.arrays import FloatArray
from frictus_hardware.base import TouchReport
from frictus_hardware.nidaq.backend import NiRig
from frictus_hardware.nidaq.config import NiConfig
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.screen import Screen
from frictus_service.synthesis.chain import Chain
from frictus_service.synthesis.estimator import FingerEstimator
from frictus_service.synthesis.renderer import Renderer
from frictus_service.synthesis.scene import compile_scene

RATE_HZ = 20_000.0
REPORTS_HZ = 100.0
SPEED_MM_S = 60.0
ASIDE_MM = 0.3
"""By which the report is off that shall show; small enough to be taken for the finger's."""
TEXTURE = Spectrum(components=[Component(amplitude_n=0.05, cycles_per_mm=1.0)])
SCENE = Scene(regions=[Region(texture=TEXTURE)])


@dataclass(frozen=True)
class Arrival:
    sample: int
    report: TouchReport


class Scripted:
    """A touch sensor whose reports are known beforehand."""

    finger_source = "touch"
    latency_s = 0.0

    def __init__(self, arrivals: Sequence[Arrival]) -> None:
        self._arrivals = arrivals

    def start(self) -> None:
        """Do nothing."""

    def arrived(self, first_sample: int, n_samples: int) -> tuple[TouchReport, ...]:
        end = first_sample + n_samples
        return tuple(a.report for a in self._arrivals if first_sample <= a.sample < end)

    def health(self) -> str | None:
        return None

    def stop(self) -> None:
        """Do nothing."""


def latencies(config: NiConfig, rng: np.random.Generator, n_reports: int = 8) -> list[int]:
    """Return samples from a report's arrival to the first output sample that it changes.

    The same motion is rendered twice; in the second run one report lies a little aside.

    Parameters
    ----------
    config : NiConfig
        Its address is not used.
    rng : numpy.random.Generator
    n_reports : int
    """
    found = []
    for _ in range(n_reports):
        began = int(rng.integers(0, round(RATE_HZ / REPORTS_HZ)))
        arrivals = _stroke(began)
        odd = len(arrivals) // 2 + int(rng.integers(0, 5))
        aside = arrivals[odd]
        moved = replace(aside.report, x_mm=aside.report.x_mm + ASIDE_MM)
        others = [*arrivals[:odd], replace(aside, report=moved), *arrivals[odd + 1 :]]
        one, other = _played(config, arrivals), _played(config, others)
        found.append(int(np.flatnonzero(one != other)[0]) - aside.sample)
    return found


def _stroke(began: int, n_reports: int = 30) -> list[Arrival]:
    samples = [began + round(k * RATE_HZ / REPORTS_HZ) for k in range(n_reports)]
    return [
        Arrival(at, TouchReport(float(at), 10.0 + SPEED_MM_S * at / RATE_HZ, 15.0, True))
        for at in samples
    ]


def _played(config: NiConfig, arrivals: Sequence[Arrival]) -> FloatArray:
    law, screen, block = FrictionLaw(), Screen(), config.block_samples
    scene = compile_scene(SCENE, law, screen, RATE_HZ)
    with FakeServer(FakeDevice(loop_back, record=True)) as server:
        here = replace(config, address=server.address)
        with NiRig(here, conversion(here), Scripted(arrivals)) as rig:
            rig.arm()
            renderer = Renderer(law, screen, RATE_HZ, block, scene, 0.0)
            chain = Chain(rig, FingerEstimator(RATE_HZ), renderer, block)
            for _ in range((arrivals[-1].sample + config.lead_samples) // block):
                chain.step(True)
            before = max(config.start_samples - config.device_lead_samples, 0)
            return server.device.played_v[before:].copy()


def configured(block_ms: float, lead_ms: float) -> NiConfig:
    """Return a rig of one block length; a third of the lead can still be ramped by a stop."""
    return wiring(block_ms=block_ms, lead_ms=lead_ms, reserve_ms=lead_ms / 3.0, deadline_s=20.0)
