"""The tests of a rig, on rigs that are well and on rigs with something wrong."""

import gc
import signal
from contextlib import ExitStack
from dataclasses import replace

import numpy as np
import pytest
from tests.hardware.nidaq.bench import (
    FingerTouch,
    conversion,
    input_volts,
    wiring,
)
from tests.hardware.nidaq.fake_device import FakeDevice, Plant
from tests.hardware.nidaq.fake_server import FakeServer
from tests.service.selftest.faulty import (
    BLOCK,
    RATE_HZ,
    FaultyRig,
    Spoil,
    deaf,
    late,
    quiet_rig,
    scaled,
    time_s,
)

from frictus_hardware import SimulatedConfig
from frictus_hardware.arrays import FloatArray
from frictus_hardware.base import Exchange
from frictus_hardware.errors import SensorError
from frictus_hardware.nidaq.backend import NiRig
from frictus_hardware.simulated.faults import EmptyOutput, LateBlock, LostSamples, Raised
from frictus_hardware.simulated.guided import ClientFinger
from frictus_service.selftest.playing import PEAK_V, TooStrongError, least_lead_ms, play
from frictus_service.selftest.report import Outcome
from frictus_service.selftest.suite import (
    RigUnderTest,
    measure_loop_back,
    measure_noise,
    measure_orientation,
    measure_step,
    run_tests,
)

pytestmark = pytest.mark.long


def spoiled(spoil: Spoil, simulated: bool = True) -> RigUnderTest:
    return RigUnderTest(FaultyRig(quiet_rig(), spoil, simulated), BLOCK)


def figure(outcome: Outcome, name: str) -> float:
    return next(each.value for each in outcome.figures if each.name == name)


def test_a_rig_that_is_well_passes() -> None:
    backend = FaultyRig(quiet_rig(), lambda got: got)
    outcomes = list(run_tests(RigUnderTest(backend, BLOCK)))
    assert [each.verdict for each in outcomes] == ["ok", "ok", "ok", "skip", "skip", "skip"]
    assert 0.0 < backend.loudest_v <= PEAK_V
    assert all(each.found for each in outcomes)
    assert backend.health() == "not open"


@pytest.mark.usefixtures("nothing_frozen")
def test_no_garbage_is_collected_while_a_rig_plays() -> None:
    passes: list[int] = []
    while_open: list[int] = []

    def note(phase: str, about: dict[str, int]) -> None:
        if phase == "start":
            passes.append(about["generation"])

    def litter(got: Exchange) -> Exchange:
        if not while_open:
            passes.clear()  # the one before the clock's start
        for _ in range(2 * sum(gc.get_threshold())):
            cycle: list[object] = []
            cycle.append(cycle)
        while_open.append(len(passes))
        return got

    gc.callbacks.append(note)
    try:
        play(FaultyRig(quiet_rig(), litter), np.zeros(10 * BLOCK), BLOCK)
    finally:
        gc.callbacks.remove(note)
    assert while_open
    assert not any(while_open)
    assert gc.isenabled()
    assert gc.get_freeze_count() == 0


def test_nothing_is_played_beyond_the_limit() -> None:
    backend = FaultyRig(quiet_rig(), lambda got: got)
    for drive in (np.full(100, 1.01 * PEAK_V), np.full(100, np.nan)):
        with pytest.raises(TooStrongError, match="at most 5 V"):
            play(backend, drive, BLOCK)
    assert backend.loudest_v == 0.0


@pytest.mark.parametrize(
    ("spoil", "verdict", "said"),
    [
        (scaled(-1.0), "fail", "wrong polarity"),
        (scaled(0.5), "fail", "0.5 ± .* times the drive"),
        (scaled(1.05), "warn", "1.05 ± .* times the drive"),
        (scaled(0.0), "fail", "does not follow"),
        (scaled(0.01), "fail", "does not follow"),
        (late(3), "warn", r"3\.00 ± .* samples after"),
        (late(40), "fail", r"40\.00 ± .* samples after"),
    ],
)
def test_the_loop_back_names_what_is_wrong(spoil: Spoil, verdict: str, said: str) -> None:
    found = measure_loop_back(spoiled(spoil))
    assert found.verdict == verdict
    with pytest.raises(AssertionError, match=said):
        assert not found, found.found
    assert found.to_do


def test_a_monitor_that_is_not_connected_is_noticed(rng: np.random.Generator) -> None:
    rig = spoiled(deaf(rng))
    for found in (measure_loop_back(rig), measure_step(rig)):
        assert found.verdict == "fail"
    assert "does not follow" in measure_loop_back(rig).found


def test_a_distorted_monitor_is_noticed() -> None:
    def clipped(got: Exchange) -> Exchange:
        return replace(got, voltage_v=np.clip(got.voltage_v, -1.5, 1.5))

    found = measure_loop_back(spoiled(clipped))
    assert found.verdict in {"warn", "fail"}
    assert "beside the drive" in found.found


@pytest.mark.parametrize(("delay", "verdict"), [(0, "ok"), (3, "warn"), (30, "fail")])
def test_a_late_monitor_moves_late(delay: int, verdict: str) -> None:
    found = measure_step(spoiled(late(delay)))
    assert found.verdict == verdict
    assert figure(found, "monitor moves after play_sample") == pytest.approx(delay)
    lead = figure(found, "lead promised")
    assert figure(found, "from handing over to moving") == pytest.approx(
        1e3 * (lead + delay) / RATE_HZ
    )


def test_a_promise_that_is_broken_is_noticed() -> None:
    def earlier(got: Exchange) -> Exchange:
        return replace(got, play_sample=got.play_sample - 7)

    found = measure_step(spoiled(earlier))
    assert found.verdict == "fail"
    assert "193 to 193 samples" in found.found


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        (EmptyOutput(at_sample=10_000, samples=50), "nothing to play for 50 samples"),
        (LostSamples(at_sample=10_000, samples=50), "50 sensed samples were lost"),
        (LateBlock(at_sample=10_000, samples=170), "30 samples of margin were left; 50"),
    ],
)
def test_a_loop_that_does_not_keep_up_is_noticed(
    fault: EmptyOutput | LostSamples | LateBlock, said: str
) -> None:
    found = measure_step(RigUnderTest(quiet_rig(fault), 50))
    assert found.verdict == ("warn" if isinstance(fault, LateBlock) else "fail")
    assert said in found.found
    assert "lead_ms" in found.to_do


def test_what_a_rig_could_not_take_at_once_is_offered_again_and_counted() -> None:
    found = measure_step(
        RigUnderTest(quiet_rig(Raised(at_sample=10_000, error="transient")), BLOCK)
    )
    assert found.verdict == "ok"
    assert figure(found, "blocks offered again") == 1


@pytest.mark.parametrize("lead_ms", [2.0, 5.0, 20.0])
def test_a_lead_shorter_than_a_block_is_well_while_most_of_it_is_left(lead_ms: float) -> None:
    found = measure_step(RigUnderTest(quiet_rig(lead_ms=lead_ms), BLOCK))
    assert found.verdict == "ok"
    assert figure(found, "lead promised") == 10.0 * lead_ms


@pytest.mark.parametrize(("size", "verdict"), [(0.05, "warn"), (0.5, "fail")])
def test_a_line_of_the_mains_is_noticed(
    rng: np.random.Generator, size: float, verdict: str
) -> None:
    hz = float(rng.choice([50.0, 60.0, 100.0, 120.0]))

    def humming(got: Exchange) -> Exchange:
        force = got.force_n.copy()
        force[:, 1] += size * np.sin(2.0 * np.pi * hz * time_s(got))
        return replace(got, force_n=force)

    found = measure_noise(spoiled(humming))
    assert found.verdict == verdict
    assert f"N at {hz:.1f} Hz" in found.found
    assert found.found.count("mains line") == 1


def test_noise_offset_saturation_and_dead_channels_are_noticed(
    rng: np.random.Generator,
) -> None:
    def bad(got: Exchange) -> Exchange:
        return replace(
            got,
            accel_m_s2=got.accel_m_s2 + rng.normal(0.0, 1.0, got.accel_m_s2.shape),
            voltage_v=got.voltage_v + 0.8,
            force_n=got.force_n * [1.0, 0.0, 1.0],
            saturated_samples=1,
        )

    found = measure_noise(spoiled(bad, simulated=False))
    assert found.verdict == "fail"
    for said in ("accel z has", "monitor reads 0.8", "force y does not move", "range's end"):
        assert said in found.found


def test_a_finger_on_the_screen_is_noticed() -> None:
    found = measure_noise(RigUnderTest(quiet_rig(finger=SimulatedConfig().finger), BLOCK))
    assert found.verdict == "fail"
    assert "a finger" in found.found


def test_after_a_lost_device_the_rig_is_left_alone() -> None:
    backend = quiet_rig(Raised(at_sample=5_000, error="device_lost"))
    outcomes = list(run_tests(RigUnderTest(backend, BLOCK)))
    assert [each.verdict for each in outcomes] == ["fail", *5 * ["skip"]]
    assert "injected" in outcomes[0].found
    assert backend.health() == "not open"


def test_after_a_sensor_s_fault_the_other_tests_are_made() -> None:
    backend = quiet_rig(Raised(at_sample=5_000, error="sensor"))
    outcomes = list(run_tests(RigUnderTest(backend, BLOCK)))
    assert [each.verdict for each in outcomes] == ["fail", "ok", "ok", "skip", "skip", "skip"]


def test_ctrl_c_leaves_the_rig_closed_at_zero() -> None:
    interrupted: list[Exchange] = []

    def press(got: Exchange) -> Exchange:
        if np.any(got.applied_v) and not interrupted:
            interrupted.append(got)
            signal.raise_signal(signal.SIGINT)
        return got

    rig = spoiled(press)
    former = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        measure_loop_back(rig)
    assert len(interrupted) == 1
    assert rig.backend.health() == "not open"
    assert signal.getsignal(signal.SIGINT) is former


class Tapped:
    """Someone who taps where they are asked to, on a rig whose frame is turned."""

    def __init__(self, turn: FloatArray, rng: np.random.Generator) -> None:
        self.turn = turn
        self.asked: list[str] = []
        self._rng = rng
        self._towards: FloatArray | None = None

    def ask(self, request: str) -> bool:
        self._towards = np.eye(3)["xyz".index(request.partition(" +")[2][0])]
        self.asked.append(request)
        return True

    def spoil(self, got: Exchange) -> Exchange:
        if self._towards is None:
            return got
        aside = self._towards + self._rng.normal(0.0, 0.03, 3)
        push = 2.0 * np.exp(-0.5 * ((time_s(got) - 2.0) / 0.01) ** 2)
        tap = np.outer(push, self.turn.T @ aside)
        return replace(got, force_n=got.force_n + tap, accel_m_s2=got.accel_m_s2 + 20.0 * tap)


QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


@pytest.mark.parametrize(
    ("sensor", "turn", "verdict", "off_deg"),
    [
        ("force", np.eye(3), "ok", 0.0),
        ("force", QUARTER, "fail", 90.0),
        ("accel", QUARTER @ QUARTER, "fail", 180.0),
    ],
)
def test_taps_tell_how_a_sensor_is_turned(
    rng: np.random.Generator, sensor: str, turn: FloatArray, verdict: str, off_deg: float
) -> None:
    someone = Tapped(turn, rng)
    rig = RigUnderTest(FaultyRig(quiet_rig(), someone.spoil, simulated=False), BLOCK)
    found = measure_orientation(rig, sensor, someone.ask)
    assert len(someone.asked) == 3
    assert found.verdict == verdict
    assert figure(found, "off the configured frame") == pytest.approx(off_deg, abs=12.0)
    assert all(each.uncertainty is not None for each in found.figures if "turn" in each.name)


def test_without_anyone_to_tap_the_orientation_is_skipped_with_its_reason() -> None:
    real = RigUnderTest(FaultyRig(quiet_rig(), lambda got: got, simulated=False), BLOCK)
    assert measure_orientation(real, "force", None).verdict == "skip"
    refused = measure_orientation(real, "force", lambda _request: False)
    assert (refused.verdict, refused.found) == ("skip", "nobody tapped")
    simulated = measure_orientation(
        RigUnderTest(quiet_rig(), BLOCK), "force", lambda _request: True
    )
    assert "simulated" in simulated.found


def test_without_a_tap_nothing_is_said_of_the_orientation() -> None:
    rig = RigUnderTest(FaultyRig(quiet_rig(), lambda got: got, simulated=False), BLOCK)
    with pytest.raises(SensorError, match="tap"):
        measure_orientation(rig, "force", lambda _request: True)


def swapped(rng: np.random.Generator) -> Plant:
    """Return a plant at rest; the monitor's leads are swapped."""

    def plant(output_v: FloatArray, _first: int) -> FloatArray:
        noise = rng.normal(0.0, 0.001, (output_v.size, 3))
        heard = -output_v + rng.normal(0.0, 0.0003, output_v.size)
        return input_volts(noise, 10.0 * noise, heard)

    return plant


def test_the_same_tests_run_on_an_ni_device(rng: np.random.Generator) -> None:
    with ExitStack() as stack:
        device = FakeDevice(swapped(rng), record=True)
        server = stack.enter_context(FakeServer(device))
        config = wiring(address=server.address, deadline_s=20.0, block_ms=50.0, lead_ms=120.0)
        touch = FingerTouch(SimulatedConfig(finger=ClientFinger()))
        rig = RigUnderTest(NiRig(config, conversion(config), touch), 1_000)
        outcomes = list(run_tests(rig))
        assert [each.verdict for each in outcomes] == [
            "ok",
            "fail",
            "ok",
            "skip",
            "skip",
            "skip",
        ]
        assert "polarity" in outcomes[1].found
        assert np.abs(device.played_v).max() <= PEAK_V / config.amplifier_gain
        assert device.output_v == 0.0


@pytest.mark.parametrize(
    ("lead_ms", "margin_ms", "least_ms"),
    [
        (20.0, 20.0, 2.0),
        (20.0, 18.4, 5.0),
        (20.0, 8.0, 25.0),
        (2.0, 1.9, 2.0),
        (5.0, 0.0, 11.0),
    ],
)
def test_the_least_lead_has_as_much_to_spare_as_was_used(
    lead_ms: float, margin_ms: float, least_ms: float
) -> None:
    assert least_lead_ms(lead_ms, margin_ms) == least_ms
