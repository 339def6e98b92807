"""The chain on the simulated rig: when there is output, and that offline is the same."""

from dataclasses import replace

import numpy as np
import pytest

from frictus.textures import Component, Region, Scene, Spectrum
from frictus_hardware.arrays import FloatArray
from frictus_hardware.errors import NotArmedError
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.screen import Screen
from frictus_hardware.simulated.config import SimulatedConfig
from frictus_hardware.simulated.faults import SilentTouch
from frictus_hardware.simulated.human import HumanStrokes
from frictus_hardware.simulated.rig import SimulatedRig
from frictus_hardware.simulated.twin import make_twin
from frictus_service.fidelity.measure import feel
from frictus_service.fidelity.path import BLOCK_SAMPLES, walk
from frictus_service.synthesis.chain import Chain, RenderedBlock, make_chain
from frictus_service.synthesis.estimator import FingerEstimator
from frictus_service.synthesis.renderer import RAMP_S, Renderer
from frictus_service.synthesis.scene import CompiledScene, compile_scene

RATE = 20_000.0
LAW = FrictionLaw()
SCREEN = Screen()


def scene() -> CompiledScene:
    texture = Spectrum(
        components=[
            Component(amplitude_n=0.1, cycles_per_mm=0.7),
            Component(amplitude_n=0.1, cycles_per_mm=5.0),
            Component(amplitude_n=0.1, hz=90.0),
        ]
    )
    return compile_scene(Scene(regions=[Region(texture=texture)]), LAW, SCREEN, RATE)


def run(chain: Chain, n_blocks: int, allow: bool) -> list[RenderedBlock]:
    """Steps with the arrays that the renderer will overwrite copied."""
    steps = []
    for _ in range(n_blocks):
        step = chain.step(allow)
        drive = step.rendered.drive.copy()
        steps.append(replace(step, rendered=replace(step.rendered, drive=drive)))
    return steps


def volts(steps: list[RenderedBlock]) -> FloatArray:
    return np.concatenate([step.exchange.applied_v for step in steps])


def chain_of(rig: SimulatedRig) -> Chain:
    """A chain that felt like `scene` from the first sample on."""
    renderer = Renderer(LAW, SCREEN, RATE, BLOCK_SAMPLES, scene())
    return Chain(rig, FingerEstimator(RATE), renderer, BLOCK_SAMPLES)


def human(rng: np.random.Generator, **settings: float) -> SimulatedConfig:
    return SimulatedConfig(
        finger=HumanStrokes.model_validate(settings),
        seed=int(rng.integers(2**31)),
        clock="virtual",
        force_noise_n=0.0,
        accel_noise_m_s2=0.0,
        quantisation=False,
    )


def test_live_rendering_is_what_the_offline_measure_renders(rng: np.random.Generator) -> None:
    config = human(rng)
    path = walk(config, 3.0, scene=scene(), law=LAW)
    signals, clipped = feel(path, scene(), LAW, SCREEN, make_twin(config))
    with SimulatedRig(config) as rig:
        rig.arm()
        steps = run(chain_of(rig), 600, allow=True)
    for step, course in zip(steps, path.courses, strict=True):
        assert step.course == course
    # Offline there is output from the first sample on, live when the finger has been found.
    full = next(number for number, step in enumerate(steps) if step.rendered.level == 1.0)
    assert full < 30
    begin = (full + 1) * BLOCK_SAMPLES
    lead = config.lead_samples
    live = volts(steps)[begin:-lead]
    offline = signals.voltage_v[lead:]
    np.testing.assert_array_equal(offline[begin:], live)
    truths = [step.exchange.truth for step in steps]
    felt = np.concatenate([truth.friction_n for truth in truths if truth is not None])
    later = begin + lead + 200  # the response has forgotten the ramp
    np.testing.assert_allclose(signals.friction_n[later:], felt[later:], atol=1e-9)
    assert np.std(felt[later:]) > 0.01
    assert clipped <= sum(step.rendered.clipped_samples for step in steps) + begin


def test_there_is_output_only_where_it_is_allowed(rng: np.random.Generator) -> None:
    with SimulatedRig(human(rng)) as rig:
        chain = chain_of(rig)
        steps = run(chain, 100, allow=False)  # disarmed: any output would be refused
        assert not np.any(volts(steps))
        assert all(step.quiet for step in steps)
        rig.arm()
        steps = run(chain, 40, allow=True)
        assert np.any(steps[0].exchange.applied_v)
        assert steps[-1].rendered.level == 1.0
        stopping = run(chain, 5, allow=False)
        assert [step.quiet for step in stopping] == [False, False, False, True, True]
        assert not np.any(stopping[-1].exchange.applied_v)


def test_output_while_the_rig_is_disarmed_is_an_error_and_not_silent(
    rng: np.random.Generator,
) -> None:
    with SimulatedRig(human(rng)) as rig:
        chain = chain_of(rig)
        run(chain, 100, allow=False)
        with pytest.raises(NotArmedError):
            run(chain, 1, allow=True)


def test_there_is_output_only_while_the_finger_touches(rng: np.random.Generator) -> None:
    with SimulatedRig(human(rng, lift_probability=1.0)) as rig:
        rig.arm()
        steps = run(chain_of(rig), 1_200, allow=True)
    ramp = 4
    touching = [step.in_contact for step in steps]
    assert 0 < sum(touching) < len(steps)
    for number, step in enumerate(steps):
        if not any(touching[max(number - ramp + 1, 0) : number + 1]):
            assert step.quiet
        if number >= ramp and not any(touching[number - ramp : number + 1]):
            assert not np.any(step.exchange.applied_v)
        if number >= ramp and all(touching[number - ramp : number + 1]):
            assert step.rendered.level == 1.0
    played = volts(steps)
    assert np.all(np.abs(played) <= SCREEN.peak_v)
    assert sum(step.exchange.clipped_samples for step in steps) == 0


def test_there_is_no_output_while_the_touch_sensor_is_silent(rng: np.random.Generator) -> None:
    silence = SilentTouch(at_sample=20_000, samples=20_000)
    config = human(rng).model_copy(update={"faults": (silence,)})
    with SimulatedRig(config) as rig:
        rig.arm()
        steps = run(chain_of(rig), 600, allow=True)
    first = [step.exchange.first_sample for step in steps]
    for step, sample in zip(steps, first, strict=True):
        if sample < 20_000 and sample > 2_000:
            assert not step.stale
            assert step.rendered.level == 1.0
        if 20_000 + 0.125 * RATE < sample < 40_000:  # stale after 0.1 s, then the ramp
            assert step.stale
            assert step.quiet
            assert not np.any(step.exchange.applied_v)
        if sample > 42_000:
            assert not step.stale
            assert step.rendered.level == 1.0


def test_the_root_of_the_drive_is_continuous_over_lifts_and_stops(
    rng: np.random.Generator,
) -> None:
    with SimulatedRig(human(rng, lift_probability=0.7)) as rig:
        rig.arm()
        chain = chain_of(rig)
        steps = []
        for _ in range(40):
            steps += run(chain, int(rng.integers(1, 30)), allow=bool(rng.random() < 0.7))
    root = np.sqrt(np.concatenate([step.rendered.drive for step in steps]))
    ramp = np.sqrt(3.0) / (RAMP_S * RATE)
    # In 5 ms a slip may take the target from one end of its range to the other; else the
    # texture's own 5 cycles/mm at 110 mm/s and its 90 Hz move it.
    drive = np.concatenate([step.rendered.drive for step in steps])
    touched = np.array([step.rendered.level for step in steps])
    assert np.any(touched == 0.0)
    own = 2.0 * np.pi * 5.0 * 110.0 / RATE
    small = drive[:-1] < 0.01  # near zero the root is steepest, and the envelope rules
    assert np.abs(np.diff(root))[small].max() <= ramp + own


def test_make_chain_takes_the_rate_of_its_backend() -> None:
    config = SimulatedConfig(clock="virtual", sample_rate_hz=10_000.0)
    with SimulatedRig(config) as rig:
        chain = make_chain(rig, LAW, config.screen, block_samples=50)
        step = chain.step(allow=False)
    assert step.exchange.applied_v.size == 50
    assert step.motion == step.course.motion
    assert step.quiet
