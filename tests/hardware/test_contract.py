"""What every backend promises (`frictus_hardware.base`), held to each of them."""

import gc
import runpy
import subprocess
import sys
import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
from tests.hardware.nidaq.bench import make_bench
from tests.hardware.nidaq.stub_driver import make_local_rig
from tests.hardware.replay.tapes import sine_tape

from frictus_hardware import (
    Backend,
    BackendConfig,
    Exchange,
    ReplayConfig,
    SimulatedConfig,
    SimulatedDeviceConfig,
    TouchReport,
)
from frictus_hardware.arrays import FloatArray
from frictus_hardware.base import GrowingLead
from frictus_hardware.errors import (
    ClosedError,
    ConfigError,
    NotArmedError,
    UnsafeDriveError,
)
from frictus_hardware.output import RETURN_S
from frictus_hardware.replay.tape import write_tape
from frictus_hardware.simulated.faults import EmptyOutput, LostSamples

Maker = Callable[[], Backend]
EXAMPLE = Path(__file__).parents[2] / "examples" / "own_backend.py"


def configured(name: str, device_address: str) -> BackendConfig:
    # Where time is real the lead is long, so that a busy machine does not spoil a test.
    if name == "virtual":
        return SimulatedConfig(clock="virtual", max_lead_ms=35.0)
    if name == "scaled":
        return SimulatedConfig(clock=2.5, lead_ms=800.0)
    real = SimulatedConfig(clock="real", lead_ms=200.0, max_lead_ms=260.0)
    if name == "real":
        return real
    return SimulatedDeviceConfig(address=device_address, rig=real)


@pytest.fixture(
    params=[
        "virtual",
        "scaled",
        "real",
        "device",
        "nidaqmx",
        "nidaqmx_local",
        "replay",
        "example",
    ]
)
def make(request: pytest.FixtureRequest) -> Iterator[Maker]:
    """A maker of unopened backends, which are closed after the test."""
    address = request.getfixturevalue("device_address") if request.param == "device" else ""
    made: list[Backend] = []
    with ExitStack() as servers:

        def make_one() -> Backend:
            if request.param == "nidaqmx":
                made.append(make_bench(servers, max_lead_ms=50.0).rig)
            elif request.param == "nidaqmx_local":
                request.getfixturevalue("stub_driver")
                made.append(make_local_rig())
            elif request.param == "replay":
                path = request.getfixturevalue("tmp_path") / f"{len(made)}.npz"
                with path.open("xb") as file:
                    write_tape(file, sine_tape())
                made.append(ReplayConfig(file=path, clock="virtual").make())
            elif request.param == "example":
                made.append(runpy.run_path(str(EXAMPLE))["CableRig"]())
            else:
                made.append(configured(request.param, address).make())
            return made[-1]

        yield make_one
        for backend in made:
            backend.close()


@pytest.fixture
def rig(make: Maker) -> Backend:
    """An open backend."""
    backend = make()
    backend.open()
    return backend


STARVED = ["virtual", "scaled", "real", "device", "replay"]
"""Backends that tell of underruns; on the NI device one is a lost stream."""


@pytest.fixture(params=STARVED)
def starved(request: pytest.FixtureRequest) -> Iterator[Backend]:
    """An open backend that lacks samples at 3000 and at 6000."""
    if request.param == "replay":
        path = request.getfixturevalue("tmp_path") / "gaps.npz"
        with path.open("xb") as file:
            write_tape(file, sine_tape([(0, 3_000), (3_150, 6_000), (6_070, 12_000)]))
        config: BackendConfig = ReplayConfig(file=path, clock="virtual")
    else:
        faults = (
            EmptyOutput(at_sample=3_000, samples=40),
            LostSamples(at_sample=6_000, samples=150),
        )
        address = request.getfixturevalue("device_address") if request.param == "device" else ""
        config = configured(request.param, address)
        if isinstance(config, SimulatedDeviceConfig):
            rig = config.rig.model_copy(update={"faults": faults})
            config = config.model_copy(update={"rig": rig})
        else:
            config = config.model_copy(update={"faults": faults})
    with config.make() as backend:
        yield backend


def random_drive(rng: np.random.Generator, n_samples: int) -> FloatArray:
    return rng.uniform(-70.0, 70.0, n_samples)


def test_info_is_sound_before_and_after_opening(make: Maker) -> None:
    backend = make()
    info = backend.info
    assert info.sample_rate_hz > 0.0
    assert info.lead_samples > 0
    assert 0.0 < info.screen_peak_v <= 75.0
    assert all(side > 0.0 for side in info.screen_mm)
    assert info.finger_source in {"touch", "pointer", "simulated"}
    with backend:
        assert backend.info == info


def test_one_sensed_sample_per_drive_sample(rig: Backend, rng: np.random.Generator) -> None:
    sensed = 0
    for n_samples in [1, 2, 100, *rng.integers(1, 300, 5).tolist()]:
        play = rig.next_play_sample
        got = rig.exchange(np.zeros(n_samples))
        assert got.first_sample == sensed + got.overrun_samples
        assert got.force_n.shape == got.accel_m_s2.shape == (n_samples, 3)
        assert got.voltage_v.shape == got.applied_v.shape == (n_samples,)
        assert np.all(np.isfinite(got.force_n))
        assert np.all(np.isfinite(got.accel_m_s2))
        assert got.play_sample == play == got.first_sample + rig.info.lead_samples
        assert 0 <= got.margin_samples <= rig.info.lead_samples
        sensed = got.first_sample + n_samples
        assert rig.next_play_sample == sensed + rig.info.lead_samples
        if rig.info.simulated and rig.info.backend != "replay":
            assert got.truth is not None
            assert got.truth.friction_n.shape == (n_samples,)
            assert got.truth.position_mm.shape == got.truth.velocity_mm_s.shape
            assert got.truth.position_mm.shape == (n_samples, 2)


def test_applied_appears_in_the_monitor_exactly_one_lead_later(
    rig: Backend, rng: np.random.Generator
) -> None:
    rig.arm()
    lead = rig.info.lead_samples
    applied = np.zeros(3 * lead + 1_000)
    known = np.ones(applied.size, dtype=np.bool_)  # all but what came too late to play
    sensed: list[Exchange] = []
    while rig.next_play_sample < 2 * lead + 500:
        got = rig.exchange(random_drive(rng, int(rng.integers(1, 200))))
        played = slice(got.play_sample, got.play_sample + got.applied_v.size)
        applied[played] = got.applied_v
        known[got.play_sample : got.play_sample + got.underrun_samples] = False
        sensed.append(got)
    voltage = np.concatenate([got.voltage_v for got in sensed])
    here = known[: voltage.size]
    assert np.any(voltage)
    assert np.any(here[lead:])
    np.testing.assert_array_equal(voltage[here], applied[: voltage.size][here])


def test_after_a_gap_the_output_comes_back_over_a_ramp(starved: Backend) -> None:
    starved.arm()
    lead = starved.info.lead_samples
    underruns = 0
    stretches: list[list[Exchange]] = [[]]
    while starved.next_play_sample < 9_000 + 2 * lead:
        got = starved.exchange(np.full(100, 50.0))
        underruns += got.underrun_samples > 0
        if got.overrun_samples:
            stretches.append([])
        stretches[-1].append(got)
    assert underruns >= 2
    slope_v = 50.0 / round(RETURN_S * starved.info.sample_rate_hz)
    for stretch in stretches:
        voltage = np.concatenate([got.voltage_v for got in stretch])
        begins = max(lead + 1 - stretch[0].first_sample, 0)  # the caller's own step
        rises_v = np.diff(voltage[begins:])
        assert np.max(rises_v, initial=0.0) <= slope_v * (1.0 + 1e-9)
        assert np.all((voltage[begins:] >= 0.0) & (voltage[begins:] <= 50.0))
    assert voltage[-1] == 50.0


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_is_refused_and_nothing_output(rig: Backend, bad: float) -> None:
    rig.arm()
    drive = np.full(50, 30.0)
    drive[20] = bad
    play = rig.next_play_sample
    with pytest.raises(UnsafeDriveError, match="finite"):
        rig.exchange(drive)
    assert rig.next_play_sample == play
    heard = rig.exchange(np.zeros(rig.info.lead_samples + 60))
    assert not np.any(heard.voltage_v)


@pytest.mark.parametrize("shape", [(0,), (1, 100), (2_000_000,)])
def test_blocks_that_are_none_are_refused(rig: Backend, shape: tuple[int, ...]) -> None:
    with pytest.raises(ConfigError, match="shape"):
        rig.exchange(np.zeros(shape))
    rig.exchange(np.zeros(10))


def test_beyond_the_limit_is_clamped_counted_and_returned(rig: Backend) -> None:
    rig.arm()
    peak = rig.info.screen_peak_v
    got = rig.exchange(np.array([0.0, peak, peak + 0.1, -peak, -1e9, 10.0]))
    np.testing.assert_array_equal(got.applied_v, [0.0, peak, peak, -peak, -peak, 10.0])
    assert got.clipped_samples == 2
    heard = rig.exchange(np.zeros(rig.info.lead_samples + 10))
    assert np.max(np.abs(heard.voltage_v)) <= peak


def test_disarmed_only_zero_is_accepted(rig: Backend) -> None:
    play = rig.next_play_sample
    with pytest.raises(NotArmedError):
        rig.exchange(np.array([0.0, 1e-9]))
    assert rig.next_play_sample == play
    rig.exchange(np.zeros(10))
    rig.arm()
    rig.exchange(np.full(10, 1.0))
    rig.stop(0.01)
    with pytest.raises(NotArmedError):
        rig.exchange(np.full(10, 1.0))


def test_stop_ramps_to_zero_within_its_time(rig: Backend) -> None:
    lead = rig.info.lead_samples
    ramp_s = 0.01
    rig.arm()
    for _ in range(2):
        rig.exchange(np.full(lead // 2, 50.0))
    before = rig.exchange(np.full(100, 50.0))
    rig.stop(ramp_s)
    rig.stop(ramp_s)  # harmless
    after = rig.exchange(np.zeros(lead + 200))
    voltage = np.concatenate([before.voltage_v, after.voltage_v])
    if after.underrun_samples == before.underrun_samples == 0:
        assert np.all(before.voltage_v == 50.0)
    assert np.all(np.diff(np.abs(after.voltage_v)) <= 0.0)
    assert np.all(voltage >= 0.0)
    ramp = np.count_nonzero((after.voltage_v > 0.0) & (after.voltage_v < 50.0))
    assert ramp <= round(ramp_s * rig.info.sample_rate_hz)
    assert ramp > 0.5 * ramp_s * rig.info.sample_rate_hz
    assert not np.any(after.voltage_v[lead:])


def test_the_lead_grows_while_nothing_is_output_and_stays_so(
    make: Maker, rng: np.random.Generator
) -> None:
    backend = make()
    before, longest = backend.info.lead_samples, backend.info.max_lead_samples
    if not isinstance(backend, GrowingLead):
        assert longest <= before
        return
    with pytest.raises(ClosedError):
        backend.lengthen_lead(before)
    backend.open()
    heard = [backend.exchange(np.zeros(70))]
    backend.lengthen_lead(before)
    for wrong in (before - 1, max(before, longest) + 1):
        with pytest.raises(ConfigError, match=f"{before}, as now, to {longest}"):
            backend.lengthen_lead(wrong)
    lead = (before + longest) // 2
    backend.lengthen_lead(lead)
    assert backend.info.lead_samples == lead
    assert backend.next_play_sample == 70 + lead
    backend.arm()
    with pytest.raises(ConfigError, match="armed"):
        backend.lengthen_lead(longest)
    drive = random_drive(rng, 200)
    got = backend.exchange(drive)
    assert got.play_sample == 70 + lead == got.first_sample + lead
    heard += [got, backend.exchange(np.zeros(lead)), backend.exchange(np.zeros(100))]
    assert backend.next_play_sample == heard[-1].first_sample + 100 + lead
    voltage = np.concatenate([each.voltage_v for each in heard])
    if not any(each.underrun_samples for each in heard):
        assert not voltage[: 70 + lead].any()
        np.testing.assert_array_equal(voltage[70 + lead : 270 + lead], got.applied_v)
    backend.stop(0.01)
    backend.close()
    backend.open()
    assert backend.info.lead_samples == backend.next_play_sample == lead
    assert backend.exchange(np.zeros(70)).play_sample == lead


def test_stop_is_safe_at_any_time(make: Maker) -> None:
    backend = make()
    backend.stop(0.01)
    with backend:
        backend.stop(0.01)
        backend.arm()
        backend.stop(0.0)
        backend.stop(10.0)
        backend.exchange(np.zeros(10))
    backend.stop(0.01)


def test_armed_again_after_a_stop(rig: Backend) -> None:
    lead = rig.info.lead_samples
    rig.arm()
    rig.exchange(np.full(100, 30.0))
    rig.stop(0.005)
    rig.arm()
    got = rig.exchange(np.full(50, 20.0))
    heard = rig.exchange(np.full(lead, 20.0))
    start = got.play_sample - heard.first_sample
    if got.underrun_samples == 0:
        assert heard.voltage_v[start] == 20.0


def test_closing_twice_is_harmless_and_then_it_is_closed(make: Maker) -> None:
    backend = make()
    for call in (backend.arm, lambda: backend.exchange(np.zeros(10))):
        with pytest.raises(ClosedError):
            call()
    with backend:
        assert backend.health() is None
        backend.exchange(np.zeros(10))
    backend.close()
    backend.close()
    assert backend.health() is not None
    with pytest.raises(ClosedError):
        backend.exchange(np.zeros(10))


def test_opens_anew_disarmed_at_sample_0(make: Maker) -> None:
    backend = make()
    for _ in range(2):
        with backend:
            with pytest.raises(NotArmedError):
                backend.exchange(np.full(5, 1.0))
            got = backend.exchange(np.zeros(5))
            assert got.first_sample == 0
            backend.arm()
            backend.exchange(np.full(5, 1.0))


def test_closes_whatever_happens(make: Maker) -> None:
    backend = make()
    with pytest.raises(KeyError), backend:
        raise KeyError
    with pytest.raises(ClosedError):
        backend.exchange(np.zeros(1))


def test_touches_arrive_in_order_at_their_declared_age(rig: Backend) -> None:
    rate = rig.info.sample_rate_hz
    reports: list[TouchReport] = []
    for _ in range(20):
        got = rig.exchange(np.zeros(200))
        for report in got.touches:
            arrival = report.measured_sample + rig.info.touch_latency_s * rate
            assert got.first_sample <= arrival < got.first_sample + 200
            assert 0.0 <= report.x_mm <= rig.info.screen_mm[0]
            assert 0.0 <= report.y_mm <= rig.info.screen_mm[1]
        reports.extend(got.touches)
    assert len(reports) > 5
    assert np.all(np.diff([report.measured_sample for report in reports]) > 0.0)


@pytest.mark.long
def test_no_memory_grows_in_a_process_of_its_own() -> None:
    """Beside threads of others, as sessions that other tests share, tracemalloc crashes."""
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-n", "0", "-m", "alone", __file__],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout
    assert " 8 passed" in done.stdout, done.stdout


@pytest.mark.alone
def test_memory_does_not_grow_with_time(rig: Backend) -> None:
    def run(n_blocks: int) -> None:
        for _ in range(n_blocks):
            rig.exchange(np.zeros(20))

    run(20)
    tracemalloc.start()
    try:
        run(20)
        gc.collect()
        before = tracemalloc.get_traced_memory()[0]
        run(200)
        gc.collect()
        grown = tracemalloc.get_traced_memory()[0] - before
    finally:
        tracemalloc.stop()
    assert grown < 100_000  # what was sensed meanwhile takes 700,000 bytes
