"""Runs every compiled part once, before anything is armed: compiling takes seconds."""

import base64
import io
import statistics
import time
from math import ceil
from typing import Final

import numpy as np
from PIL import Image

from frictus.messages import Excitation, Tone
from frictus.stream import StreamFrame
from frictus.textures import Component, Map, Region, Scene, Spectrum
from frictus_hardware import SimulatedConfig, open_backend
from frictus_hardware.simulated.human import HumanStrokes
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_service.synthesis.chain import Chain, make_chain
from frictus_service.synthesis.compensability import inverse_of
from frictus_service.synthesis.excitation import compile_excitation
from frictus_service.synthesis.model_law import law_of, placeholder_model
from frictus_service.synthesis.renderer import Playable, Renderer
from frictus_service.synthesis.scene import compile_scene
from frictus_service.synthesis.stream import StreamBudget

EVERY_CORRECTION: Final = (
    ("fractional_rolloff", {"excess_order": 0.1}),
    ("charge_leakage", {"corner_hz": 1.0}),
    ("residual_quadratic", {"share": 0.01}),
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
    with open_backend(config) as rig:
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
