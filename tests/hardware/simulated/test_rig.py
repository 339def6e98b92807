"""What only the simulated rig has: truth, reproducibility, a finger that a client moves."""

from dataclasses import dataclass

import numpy as np
import pytest
from pydantic import ValidationError

from frictus_hardware import SimulatedConfig
from frictus_hardware.errors import ConfigError
from frictus_hardware.physics import friction
from frictus_hardware.physics.screen import Screen, drive_fraction_of, screen_voltage
from frictus_hardware.physics.twin import Signals, Twin
from frictus_hardware.simulated.clock import VirtualClock
from frictus_hardware.simulated.config import SimulatedParticipant
from frictus_hardware.simulated.guided import ClientFinger
from frictus_hardware.simulated.human import HumanStrokes
from frictus_hardware.simulated.rig import SimulatedRig
from frictus_hardware.simulated.twin import make_twin

VIRTUAL = SimulatedConfig(clock="virtual")


def test_truth_is_the_law_of_the_participant_on_what_was_played() -> None:
    person = SimulatedParticipant(gain_n=0.6, cutoff_0_hz=800.0)
    config = SimulatedConfig(clock="virtual", participant=person)
    voltage, truths = [], []
    with SimulatedRig(config) as rig:
        rig.arm()
        for _ in range(50):
            drive = np.full(100, 0.5)
            got = rig.exchange(screen_voltage(Screen(), drive, rig.next_play_sample, 20_000.0))
            voltage.append(got.voltage_v)
            assert got.truth is not None
            truths.append(got.truth)
    speed = np.hypot(*np.concatenate([truth.velocity_mm_s for truth in truths]).T)
    expected, _ = friction.respond(
        person.law,
        drive_fraction_of(Screen(), np.concatenate(voltage)),
        speed,
        20_000.0,
    )
    expected *= friction.motion_fade(speed)
    seen = np.concatenate([truth.friction_n for truth in truths])
    # The twin's speed runs straight between samples, here it is held.
    np.testing.assert_allclose(seen, expected, atol=1e-3 * np.max(expected))


def test_seed_decides_all_that_is_random() -> None:
    def forces(seed: int) -> np.ndarray:
        with SimulatedRig(SimulatedConfig(clock="virtual", seed=seed)) as rig:
            return np.concatenate([rig.exchange(np.zeros(n)).force_n for n in (70, 30, 200)])

    np.testing.assert_array_equal(forces(1), forces(1))
    assert not np.array_equal(forces(1), forces(2))


def test_a_client_moves_the_finger() -> None:
    config = SimulatedConfig(clock="virtual", finger=ClientFinger())
    with SimulatedRig(config) as rig:
        assert rig.info.finger_source == "pointer"
        got = rig.exchange(np.zeros(2_000))
        assert not any(report.in_contact for report in got.touches)
        rig.move_finger(20.0, 10.0, in_contact=True)
        rig.exchange(np.zeros(2_000))
        got = rig.exchange(np.zeros(2_000))
        assert [(r.x_mm, r.y_mm, r.in_contact) for r in got.touches][-1] == (20.0, 10.0, True)


@pytest.mark.parametrize(
    ("finger", "order"),
    [(HumanStrokes(), ["sense", "wait"]), (ClientFinger(), ["wait", "sense"])],
)
def test_a_block_is_there_when_it_is_over_unless_the_finger_may_still_be_moved(
    finger: HumanStrokes | ClientFinger, order: list[str]
) -> None:
    done: list[str] = []

    class Noted(VirtualClock):
        def wait_until(self, sample: int) -> None:
            done.append("wait")
            super().wait_until(sample)

    @dataclass
    class Watched:
        """A stage that tells when the twin runs."""

        def initial(self) -> None: ...

        def run(self, signals: Signals, state: None) -> tuple[Signals, None]:
            done.append("sense")
            return signals, state

    config = SimulatedConfig(clock="virtual", finger=finger)
    with SimulatedRig(config, Noted(), Twin((*make_twin(config).stages, Watched()))) as rig:
        done.clear()
        rig.exchange(np.zeros(100))
    assert done == order


def test_an_exchange_is_its_three_parts() -> None:
    with SimulatedRig(VIRTUAL) as whole, SimulatedRig(VIRTUAL) as parts:
        for _ in range(20):
            at_once = whole.exchange(np.zeros(100))
            handed = parts.hand_over(np.zeros(100))
            parts.wait(handed)
            bit_by_bit = parts.sense(handed)
            np.testing.assert_array_equal(at_once.force_n, bit_by_bit.force_n)
            assert at_once.touches == bit_by_bit.touches
            assert whole.next_play_sample == parts.next_play_sample


def test_other_fingers_do_not_follow_points() -> None:
    with SimulatedRig(VIRTUAL) as rig, pytest.raises(ConfigError, match="human"):
        rig.move_finger(1.0, 1.0, in_contact=True)


def test_opened_by_its_configuration() -> None:
    with VIRTUAL.make() as backend:
        assert backend.exchange(np.zeros(10)).first_sample == 0
    VIRTUAL.reset()  # nothing to do


@pytest.mark.parametrize(
    "wrong",
    [
        {"lead_ms": 0.0},
        {"lead_ms": float("nan")},
        {"max_lead_ms": 19.0},
        {"max_lead_ms": 1_001.0},
        {"max_lead_ms": float("inf")},
        {"sample_rate_hz": "20000"},
        {"screen_peak_v": 400.0},
        {"clock": -1.0},
        {"clock": "fast"},
        {"colour": "red"},
        {"finger": {"kind": "octopus"}},
        {"faults": [{"kind": "raise", "at_sample": -1, "error": "transient"}]},
    ],
)
def test_a_wrong_configuration_is_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        SimulatedConfig.model_validate(wrong)


def test_a_configuration_as_toml_gives_it() -> None:
    read = SimulatedConfig.model_validate(
        {
            "kind": "simulated",
            "lead_ms": 10,
            "clock": 2,
            "screen_mm": [60, 30.0],
            "finger": {"kind": "steady", "speed_mm_s": 40, "press": {"wander_n": 0}},
        }
    )
    assert read.lead_samples == 200
    assert read.screen_mm == (60.0, 30.0)
