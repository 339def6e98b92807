"""Excitations on the whole rig: what the monitor sees, and that nothing outlives its lease."""

from typing import Any

import numpy as np
import pytest

from frictus.messages import Excitation, Tone
from frictus.textures import Scene
from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.simulated.faults import LostSamples, SilentTouch
from frictus_service.daemon.inboxes import SceneUpdate
from frictus_service.daemon.safety import ClientVanished, Disarm, FaultRaised, Reset, Stop
from frictus_service.synthesis.scene import compile_excitation

HZ = (30.0, 123.4, 700.0, 1_999.0)
SAFE = 0.5 / len(HZ)


def excitation(hz: tuple[float, ...] = HZ) -> Excitation:
    return Excitation(tones=[Tone(hz=f, amplitude=0.5 / len(hz), phase_rad=f) for f in hz])


def excite(bench: Any, asked: Excitation, arming: int | None = None) -> None:
    """Order an excitation for the present arming, or for a given one."""
    compiled = compile_excitation(asked, FrictionLaw(), bench.rate_hz)
    arming = bench.interlock.state.armings if arming is None else arming
    bench.orders.scene.append(SceneUpdate(compiled, arming=arming))


def excited(bench: Any, lease_s: float = 10.0) -> Any:
    """Return the bench armed and excited, its finger followed."""
    bench.turn(0.2)
    bench.arm(lease_s)
    excite(bench, excitation())
    bench.turn(0.5)
    assert bench.turns[-1].exchange.voltage_v.any()
    return bench


def amplitudes(bench: Any, first: int, n: int, hz: tuple[float, ...]) -> FloatArray:
    """Return bias and complex amplitudes of the drive fraction that the monitor shows.

    By least squares on ``2 V^2 / V_pk^2 / (1 + cos 4 pi f_c t)`` where the carrier is large, so
    that the carrier's own lines play no part.
    """
    n_s = np.arange(first, first + n)
    voltage = bench.voltage_v()[n_s]
    carrier = np.cos(2.0 * np.pi * (n_s * 7_000.0 % bench.rate_hz) / bench.rate_hz) ** 2
    seen = carrier > 0.2
    drive = voltage[seen] ** 2 / (bench.rig.config.screen_peak_v**2 * carrier[seen])
    turns = np.exp(2j * np.pi * np.outer(n_s[seen] / bench.rate_hz, hz))
    basis = np.column_stack([np.ones(drive.size), turns.real, -turns.imag])
    found, *_ = np.linalg.lstsq(basis, drive, rcond=None)
    k = len(hz)
    return np.concatenate([found[:1], found[1 : k + 1] + 1j * found[k + 1 :]])


def test_the_monitor_shows_what_was_asked_for(make_bench: Any) -> None:
    bench = excited(make_bench())
    begin = bench.clock.sample()
    bench.turn(1.0)
    found = amplitudes(bench, begin, 19_000, HZ)
    wanted = [0.5, *(SAFE * np.exp(1j * f) for f in HZ)]
    np.testing.assert_allclose(found, wanted, atol=2e-4)


def test_phases_hang_on_the_devices_samples_across_lost_ones(make_bench: Any) -> None:
    bench = excited(make_bench())
    bench.rig.faults.add(LostSamples(at_sample=bench.clock.sample() + 500, samples=137))
    bench.turn(0.5)
    end = bench.turns[-1].exchange.first_sample
    voltage = bench.turns[-1].exchange.voltage_v
    n_s = np.arange(end, end + voltage.size)
    m = 0.5 + SAFE * sum(np.cos(2.0 * np.pi * f * n_s / bench.rate_hz + f) for f in HZ)
    carrier = np.cos(2.0 * np.pi * (n_s * 7_000.0 % bench.rate_hz) / bench.rate_hz)
    np.testing.assert_allclose(voltage, 75.0 * np.sqrt(m) * carrier, atol=0.05)


@pytest.mark.parametrize(
    "event",
    [
        Stop("ben"),
        Disarm("ann"),
        ClientVanished("ann"),
        FaultRaised("safety", "monitor off"),
        FaultRaised("link_lost", "cable"),
    ],
    ids=lambda event: type(event).__name__,
)
def test_an_excitation_ends_within_100_ms_and_does_not_come_back(
    make_bench: Any, event: Any
) -> None:
    bench = excited(make_bench())
    told_s = bench.now_s
    bench.feed(event)
    bench.turn(0.3)
    assert told_s < bench.last_output_s() <= told_s + 0.1
    if isinstance(event, FaultRaised):
        return
    bench.arm()
    bench.turn(0.5)
    assert bench.last_output_s() <= told_s + 0.1, "the standing scene is smooth"


def test_a_tripped_rig_plays_no_excitation_after_its_reset(make_bench: Any) -> None:
    bench = excited(make_bench())
    bench.feed(FaultRaised("safety", "monitor off"))
    bench.turn(0.3)
    silent_s = bench.last_output_s()
    bench.feed(Reset())
    bench.arm()
    bench.turn(0.5)
    assert bench.last_output_s() == silent_s


def test_an_excitation_ends_with_the_lease(make_bench: Any) -> None:
    bench = excited(make_bench(), lease_s=0.6)
    bench.turn(0.5)
    assert 0.8 - 0.01 < bench.last_output_s() <= 0.8 + 0.1


def test_no_drive_without_a_fresh_finger(make_bench: Any) -> None:
    bench = excited(make_bench())
    at = bench.clock.sample()
    bench.rig.faults.add(SilentTouch(at_sample=at, samples=10_000))
    bench.turn(0.5)
    limit_s = (at / bench.rate_hz) + 1e-3 * bench.config.limits.finger_stale_ms + 0.1
    assert bench.last_output_s() <= limit_s
    bench.turn(0.5)
    assert bench.last_output_s() > limit_s, "it goes on with the reports"


def test_a_scene_ends_an_excitation(make_bench: Any, texture: Scene) -> None:
    bench = excited(make_bench())
    bench.play(texture)
    bench.turn(0.3)
    assert np.all(np.isfinite(bench.loop.rendering.chain.renderer._target))


@pytest.mark.parametrize("late", [False, True])
def test_an_order_of_an_ended_arming_is_never_played(make_bench: Any, late: bool) -> None:
    """The lease may end between the order and the loop, or before the device is armed."""
    bench = make_bench()
    bench.turn(0.2)
    bench.arm()
    arming = bench.interlock.state.armings
    if late:
        bench.turn(0.2)
    else:
        excite(bench, excitation(), arming)
    bench.feed(Stop("ben"))
    if late:
        excite(bench, excitation(), arming)
    bench.turn(0.2)
    bench.arm()
    bench.turn(0.5)
    assert bench.last_output_s() == 0.0


def test_an_arming_that_ends_while_the_ramp_is_played_takes_its_excitation_along(
    make_bench: Any,
) -> None:
    bench = excited(make_bench())
    bench.feed(Stop("ben"))
    bench.turn(0.005)
    silent_s = bench.now_s + 0.1
    bench.arm()  # the ramp of the former is still under way: the device is not armed yet
    excite(bench, excitation())
    bench.turn(0.005)
    bench.feed(Stop("ben"))
    bench.turn(0.1)
    bench.arm()
    bench.turn(0.5)
    assert bench.last_output_s() <= silent_s
