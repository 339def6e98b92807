"""Forms without a cause: what the twin does in time is what is predicted when it is steady."""

from dataclasses import replace

import numpy as np
import pytest

from frictus_hardware.physics.effects import FORMS, extended
from frictus_hardware.physics.forms import band_names
from frictus_hardware.physics.paths import FollowPath
from frictus_hardware.physics.schedule import SlidingConditions
from frictus_hardware.physics.simulator import Probe, Simulator, predict
from frictus_hardware.physics.twin import Signals

RATE_HZ = 80_000.0
SPEED_MM_S, FORCE_N, MINUTES = 80.0, 0.5, 12.0

EXAMPLES = {
    "extra_resonance": {"depth": 0.3, "frequency_hz": 182.0, "by_speed": 0.5},
    "echo": {"share": 0.2, "delay_s": 0.0011234, "by_force": 0.5},
    "pole_zero_pair": {"share": 0.4, "corner_hz": 300.0},
    "empirical": {"strength": 1.0, **dict.fromkeys(band_names(), 0.05)},
    "empirical_by_speed": {"strength": 1.0, **dict.fromkeys(band_names(), -0.1)},
}


def _conditions(tones_hz: np.ndarray) -> SlidingConditions:
    one = np.ones(tones_hz.size)
    return SlidingConditions(SPEED_MM_S * one, FORCE_N * one, 35.0 * one, one, MINUTES * one)


def _response(simulator: Simulator, tones_hz: np.ndarray) -> np.ndarray:
    zero = np.zeros(tones_hz.size)
    probe = Probe(tones_hz, zero.astype(complex), zero, zero, _conditions(tones_hz))
    return predict(simulator, probe, simulator.mount).friction


@pytest.mark.parametrize("id_", EXAMPLES)
def test_the_twin_follows_a_path_as_it_is_predicted(id_: str) -> None:
    tones_hz = np.array([40.0, 180.0, 640.0, 1500.0])
    simulator = extended(Simulator(), [(id_, EXAMPLES[id_])])
    expected = _response(simulator, tones_hz) / _response(Simulator(), tones_hz)
    time_s = np.arange(int(1.5 * RATE_HZ)) / RATE_HZ
    one = np.ones(time_s.size)
    still = np.column_stack([35.0 * one, one])
    moving = np.column_stack([SPEED_MM_S * one, 0.0 * one])
    late = time_s >= 0.5
    for tone_hz, factor in zip(tones_hz, expected, strict=True):
        drive = 0.5 + 0.4 * np.cos(2.0 * np.pi * tone_hz * time_s)
        signals = replace(
            Signals.driven(RATE_HZ, one, still, moving, FORCE_N * one, one > 0.0),
            drive_fraction=drive,
        )
        (path,) = simulator.paths
        stage, halves, state = FollowPath(path, MINUTES), [], None
        for part in (slice(0, 50_001), slice(50_001, None)):  # as blocks come
            out, state = stage.run(signals.rows(part), state)
            halves.append(out.drive_fraction)
        turned = np.exp(-2j * np.pi * tone_hz * time_s[late])
        felt, given = (np.mean(each[late] * turned) for each in (np.concatenate(halves), drive))
        assert abs(felt / given / factor - 1.0) < 3e-3


def test_a_switch_turns_at_its_threshold_and_a_knee_bends_there() -> None:
    tone = np.array([30.0])
    bare = _response(Simulator(), tone)

    def times(id_: str, **values: float) -> float:
        return float(abs(_response(extended(Simulator(), [(id_, values)]), tone) / bare)[0])

    assert times("gain_switch_by_time", log_change=0.3, threshold_min=10.0) == pytest.approx(
        np.exp(0.3), rel=1e-3
    )
    assert times("gain_switch_by_time", log_change=0.3, threshold_min=15.0) == pytest.approx(1)
    assert times("gain_knee_above_force", exponent=-0.5, threshold_n=0.4) == pytest.approx(
        0.8**0.5
    )
    assert times("gain_knee_below_force", exponent=-0.5, threshold_n=0.4) == pytest.approx(1.0)
    # At its threshold a soft bend has gone the softness times ln 2; far from it, it is sharp.
    soft = {"exponent": -0.5, "softness": 0.1}
    for side in ("above", "below"):
        sign = 1.0 if side == "above" else -1.0
        assert times(f"gain_knee_{side}_force", threshold_n=0.5, **soft) == pytest.approx(
            2.0 ** (-0.05 * sign)
        )
    assert times("gain_knee_above_force", threshold_n=0.2, **soft) == pytest.approx(
        0.4**0.5, rel=1e-4
    )
    # A width after its threshold, a switch has done 1 / (1 + 1 / e) of it.
    assert times("gain_switch_by_force", log_change=0.3, threshold_n=0.45, width_n=0.05) == (
        pytest.approx(np.exp(0.3 / (1.0 + np.exp(-1.0))))
    )
    assert times("gain_coupling_of_speed_and_force", exponent=0.4) == pytest.approx(
        np.exp(0.4 * np.log(80 / 60) * np.log(0.5 / 0.4))
    )


def test_a_dose_is_not_followed_beyond_where_it_was_measured() -> None:
    values = {"depth": 0.2, "by_speed": 1.0}
    (path,) = extended(Simulator(), [("extra_resonance", values)]).paths
    around = _conditions(np.array([200.0, 200.0]))
    at = path.dose.at(replace(around, speed_mm_s=np.array([100.0, 400.0])))
    assert at == pytest.approx([0.4, 0.4])


@pytest.mark.parametrize("id_", FORMS)
def test_a_dose_of_nothing_changes_nothing(id_: str) -> None:
    dose = FORMS[id_].parameters[0]
    assert extended(Simulator(), [(id_, {dose.name: 0.0})]) == Simulator()
    assert extended(Simulator(), [(id_, {dose.name: dose.step})]) != Simulator()
