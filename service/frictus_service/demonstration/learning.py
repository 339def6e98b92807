"""A finger that the rig learns while it explores, and what that is worth on its strokes."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

import frictus
from frictus.keys import Topics
from frictus.messages import EstimateState
from frictus.model import Model
from frictus.textures import Region, Scene, Spectrum
from frictus_hardware import SimulatedConfig
from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.friction import FrictionLaw, motion_fade
from frictus_hardware.physics.stages import standard_twin
from frictus_hardware.simulated.config import SimulatedParticipant
from frictus_hardware.simulated.human import HumanStrokes
from frictus_service.config import LOCAL, Config, TrackerConfig
from frictus_service.daemon.processes.supervisor import Supervisor
from frictus_service.demonstration.comparison import WINDOW_SAMPLES
from frictus_service.demonstration.stage import START_S, STARTED_S, demo_config
from frictus_service.fidelity.measure import feel
from frictus_service.fidelity.path import exact_friction, walk
from frictus_service.fidelity.preview import band_power, windows
from frictus_service.synthesis.components import components_of
from frictus_service.synthesis.scene import compile_scene

PERSON: Final = SimulatedParticipant(
    gain_n=0.30, cutoff_0_hz=2 * 385.68, slope_hz_per_mm_s=2 * 13.811
)
"""Feels less than the placeholder takes fingers to, and follows the drive twice as far up."""
GAIN: Final = 0.5
"""Of the texture: the drive gives so much by either model, so that only the law differs."""
SILENT_S: Final = 20.0
LEASE_MS: Final = 2_000
"""The demo computes beside it, and a busy machine holds its renewals up."""


def learning_config(folder: Path, port: int, seed: int) -> Config:
    """Return a rig with a placeholder model, a finger that it does not fit, and `adapt` on.

    Parameters
    ----------
    folder : Path
        For all that is written.
    port : int
        Of the API; 0: any.
    seed : int
        Of the finger's way and the sensors' noise.
    """
    tracker = TrackerConfig(policy="adapt", audit=folder / "adaptations.jsonl")
    config = demo_config(folder, HumanStrokes(), port, seed, PERSON)
    return config.model_copy(update={"tracker": tracker})


@dataclass(frozen=True, slots=True)
class Learned:
    """How a finger was learned.

    Attributes
    ----------
    before, after : Model
        In force when it began, and when it ended.
    state : EstimateState
        The last.
    first_change_s : float
        From arming to the first change of the model; NaN without any.
    """

    before: Model
    after: Model
    state: EstimateState
    first_change_s: float


def learn(
    config: Config,
    texture: Spectrum,
    seconds: float,
    say: Callable[[str], None],
    show: Callable[[str], None],
    look: Callable[[float, EstimateState], None],
) -> Learned:
    """Play a texture under the finger while the rig learns it.

    Parameters
    ----------
    config : Config
        As `learning_config` returns it.
    texture : Spectrum
        That is felt.
    seconds : float
        How long the finger explores.
    say : callable
        Told what goes on.
    show : callable
        Gets the address of the page.
    look : callable
        Gets the seconds since arming, and each estimate.

    Raises
    ------
    FrictusError
        If the rig does not start, refuses, or nothing tracks it.
    """
    with Supervisor(config, say=say) as supervisor:
        supervisor.wait_ready(START_S)
        with frictus.connect(config.router.endpoint, "demo") as client:
            rig = client.rig(config.rig, config.site, wait_s=STARTED_S)
            rig.set_scene(_scene(texture))
            before = rig.model().model
            first_change_s = float("nan")
            with (
                rig.watch(Topics.ESTIMATE, timeout_s=SILENT_S) as states,
                rig.arm(LEASE_MS, share_with=(LOCAL,)),
            ):
                show(f"http://{config.api.host}:{config.api.port}/#/live/{config.rig}")
                begun_s = time.monotonic()
                for heard in states:
                    state = EstimateState.model_validate(heard)
                    at_s = time.monotonic() - begun_s
                    if state.changes and np.isnan(first_change_s):
                        first_change_s = at_s
                    look(at_s, state)
                    if at_s >= seconds:
                        break
            return Learned(before, rig.model().model, state, first_change_s)


def _scene(texture: Spectrum) -> Scene:
    return Scene(regions=[Region(texture=texture, gain=GAIN)])


def same_strokes(
    config: Config, texture: Spectrum, seconds: float, laws: Mapping[str, FrictionLaw]
) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Return what is felt on the same strokes by renderings that undo one law each.

    The simulated finger's way is a function of time alone, so it is walked again.

    Parameters
    ----------
    config : Config
        Of the rig.
    texture : Spectrum
        That was felt.
    seconds : float
        Of the strokes, from their beginning.
    laws : mapping of str to FrictionLaw
        By what they are called.

    Returns
    -------
    target : ndarray, shape (16,)
        Power that was asked for in third octaves, N².
    felt : dict of str to ndarray, shape (16,)
        By the law that was undone.
    """
    backend = config.backend
    assert isinstance(backend, SimulatedConfig)
    path = walk(backend, seconds)
    rate_hz, screen = path.sample_rate_hz, backend.screen
    parts = windows(path.position_mm.shape[0], WINDOW_SAMPLES)
    friction = exact_friction(components_of(texture), path.position_mm, 0, rate_hz)
    fade, twin = motion_fade(path.speed_mm_s), standard_twin(screen, backend.participant.law)
    felt, targets = {}, []
    for name, law in laws.items():
        scene = compile_scene(_scene(texture), law, screen, rate_hz)
        applied = scene.applied
        wanted = (applied.bias_n + applied.gain * GAIN * friction) * fade
        targets.append(band_power(wanted, rate_hz, parts))
        signals, _ = feel(path, scene, law, screen, twin)
        felt[name] = band_power(signals.friction_n, rate_hz, parts)
    # The mean friction differs a little by law, and fades in and out with the motion.
    return targets[0], felt
