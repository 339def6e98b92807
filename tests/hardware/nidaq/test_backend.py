"""The backend over the fake server, whose clock passes by reads alone."""

import subprocess
import sys

import numpy as np
import pytest
from tests.hardware.nidaq.bench import (
    BenchMaker,
    FingerTouch,
    LinearConversion,
    conversion,
    twin_plant,
    wiring,
)

from frictus_hardware.arrays import FloatArray
from frictus_hardware.base import Exchange
from frictus_hardware.errors import DriverMissingError, SensorError
from frictus_hardware.nidaq.backend import NiRig
from frictus_hardware.nidaq.sensing import Sensed
from frictus_hardware.simulated.config import SimulatedConfig
from frictus_hardware.simulated.rig import SimulatedRig


def random_sizes(rng: np.random.Generator, n_blocks: int) -> list[int]:
    return [int(size) for size in rng.integers(1, 350, n_blocks)]


@pytest.mark.parametrize("seconds", [0.8, pytest.param(60.0, marks=pytest.mark.campaign)])
def test_what_was_handed_over_is_what_was_played_sample_for_sample(
    make_bench: BenchMaker, rng: np.random.Generator, seconds: float
) -> None:
    bench = make_bench(record=True)
    with bench.rig as rig:
        lead = rig.info.lead_samples
        handed = [np.zeros(lead)]
        play = lead
        rig.arm()
        while play < seconds * rig.info.sample_rate_hz:
            got = rig.exchange(rng.uniform(-80.0, 80.0, int(rng.integers(1, 350))))
            assert got.play_sample == play
            play += got.applied_v.size
            handed.append(got.applied_v)
        played_v = bench.device.played_v * rig.config.amplifier_gain
        assert played_v.size == play - lead
        np.testing.assert_array_equal(played_v, np.concatenate(handed)[: played_v.size])
    assert bench.device.output_v == 0.0
    assert not bench.device.tasks


@pytest.mark.parametrize("block_ms", [1.0, 2.0, 5.0])
def test_a_drive_plays_one_lead_after_the_last_sensed_sample(
    make_bench: BenchMaker, block_ms: float
) -> None:
    bench = make_bench(record=True, block_ms=block_ms)
    with bench.rig as rig:
        rig.arm()
        block = rig.config.block_samples
        before = rig.exchange(np.zeros(block))
        pulse = rig.exchange(np.full(block, 10.0))
        rig.exchange(np.zeros(rig.info.lead_samples))
        end = before.first_sample + block
        assert pulse.play_sample == end + rig.info.lead_samples
        assert np.flatnonzero(bench.device.played_v)[0] == pulse.play_sample


def test_every_input_sample_comes_once_and_in_order(
    make_bench: BenchMaker, rng: np.random.Generator
) -> None:
    with make_bench().rig as rig:
        blocks = [rig.exchange(np.zeros(size)) for size in random_sizes(rng, 30)]
        force_n = np.concatenate([block.force_n for block in blocks])
        accel = np.concatenate([block.accel_m_s2 for block in blocks])
    expected = 1e-4 * np.arange(len(force_n))[:, np.newaxis] * np.array([1.0, -1.0, 0.5])
    np.testing.assert_allclose(force_n, expected, atol=1e-9)
    np.testing.assert_allclose(accel, 10.0 * expected, atol=1e-9)


def test_the_physical_model_behind_the_device_feels_as_the_simulated_rig(
    make_bench: BenchMaker, rng: np.random.Generator
) -> None:
    config = SimulatedConfig(clock="virtual", lead_ms=30.0)
    bench = make_bench(plant=twin_plant(config))
    drives = [rng.uniform(-70.0, 70.0, size) for size in random_sizes(rng, 20)]

    def sensed(rig: NiRig | SimulatedRig) -> list[Exchange]:
        with rig:
            rig.arm()
            return [rig.exchange(drive) for drive in drives]

    real, simulated = sensed(bench.rig), sensed(SimulatedRig(config))
    for got, expected in zip(real, simulated, strict=True):
        np.testing.assert_allclose(got.force_n, expected.force_n, atol=1e-6)
        np.testing.assert_allclose(got.accel_m_s2, expected.accel_m_s2, atol=1e-4)
        np.testing.assert_allclose(got.voltage_v, expected.voltage_v, atol=1e-9)


def test_one_block_takes_three_remote_calls(make_bench: BenchMaker) -> None:
    bench = make_bench()
    with bench.rig as rig:
        bench.server.servicer.calls.clear()
        rig.exchange(np.zeros(rig.config.block_samples))
        assert bench.server.servicer.calls.total() == 3


def test_the_margin_is_what_the_device_still_had_to_play(make_bench: BenchMaker) -> None:
    bench = make_bench()
    with bench.rig as rig:
        queued = rig.config.device_lead_samples
        assert rig.exchange(np.zeros(100)).margin_samples == queued
        bench.device.pass_time(70)
        assert rig.exchange(np.zeros(100)).margin_samples == queued - 70
        assert rig.exchange(np.zeros(100)).margin_samples == queued


def test_a_stop_ramps_the_reserve_after_what_the_device_has(make_bench: BenchMaker) -> None:
    bench = make_bench(record=True, lead_ms=40.0, reserve_ms=15.0)
    with bench.rig as rig:
        rig.arm()
        for _ in range(20):
            rig.exchange(np.full(100, 60.0))
        stopped = bench.device.now
        rig.stop(0.01)
        rig.exchange(np.zeros(1_000))
        after_v = rig.config.amplifier_gain * bench.device.played_v[stopped:]
        fixed = rig.config.device_lead_samples
        np.testing.assert_array_equal(after_v[:fixed], 60.0)
        ramp_v = 60.0 * (1.0 - np.arange(1, 201) / 200)
        np.testing.assert_allclose(after_v[fixed : fixed + 200], ramp_v, atol=1e-9)
        assert not np.any(after_v[fixed + 200 :])


def test_closing_in_mid_drive_ends_at_zero_after_the_device_s_lead(
    make_bench: BenchMaker,
) -> None:
    bench = make_bench(record=True)
    with bench.rig as rig:
        rig.arm()
        for _ in range(10):
            rig.exchange(np.full(100, 60.0))
        closed = bench.device.now
    assert bench.device.output_v == 0.0
    after_v = bench.device.played_v[closed:]
    assert np.count_nonzero(after_v) == bench.rig.config.device_lead_samples
    assert after_v[-1] == 0.0
    assert bench.device.resets == 1  # that of the opening


def test_what_a_dead_client_left_behind_is_silenced_by_the_opening(
    make_bench: BenchMaker,
) -> None:
    bench = make_bench()
    dead, rig = bench.rig, NiRig(bench.rig.config, conversion(bench.rig.config), bench.touch)
    dead.open()
    dead.arm()
    for _ in range(10):
        dead.exchange(np.full(100, 60.0))
    assert bench.device.output_v != 0.0
    with rig:
        assert bench.device.output_v == 0.0
        rig.exchange(np.zeros(100))
        assert dead.health() is None
    dead.close()


def test_a_block_that_the_sensors_refuse_counts_as_overrun(make_bench: BenchMaker) -> None:
    bench = make_bench()
    sound = conversion(bench.rig.config)
    rig = NiRig(bench.rig.config, Overloaded(sound), bench.touch)
    with rig:
        rig.exchange(np.zeros(100))
        with pytest.raises(SensorError, match="overload"):
            rig.exchange(np.zeros(70))
        got = rig.exchange(np.zeros(30))
        assert (got.first_sample, got.overrun_samples) == (170, 70)
        assert rig.exchange(np.zeros(30)).overrun_samples == 0


class Overloaded:
    """Refuses its second block."""

    delay_samples = tare_samples = 0

    def __init__(self, sound: LinearConversion) -> None:
        self._sound = sound
        self._blocks = 0
        self.rates_hz: list[float] = []

    def start(self, conversion_rate_hz: float) -> None:
        self.rates_hz.append(conversion_rate_hz)

    def tare(self, input_v: FloatArray) -> None:
        raise AssertionError("no tare was asked for")

    def prime(self, input_v: FloatArray) -> None:
        raise AssertionError("nothing to prime")

    def __call__(self, input_v: FloatArray) -> Sensed:
        self._blocks += 1
        if self._blocks == 2:
            raise SensorError("overload")
        return self._sound(input_v)


def test_the_touch_sensor_s_trouble_is_the_rig_s(make_bench: BenchMaker) -> None:
    bench = make_bench()
    with bench.rig as rig:
        assert rig.health() is None
        bench.touch.wrong = "no report for 1 s"
        assert rig.health() == "no report for 1 s"


def test_the_conversion_is_told_how_far_the_channels_are_apart(
    make_bench: BenchMaker,
) -> None:
    bench = make_bench()
    convert = Overloaded(conversion(bench.rig.config))
    with NiRig(bench.rig.config, convert, bench.touch):
        assert convert.rates_hz == [200_000.0]


def test_nothing_of_the_vendor_is_loaded_before_opening() -> None:
    code = (
        "import sys; from frictus_hardware.nidaq import assembly, backend, config, sensing; "
        "from frictus_hardware.nidaq import settings; "
        "sys.exit(bool({'nidaqmx', 'grpc', 'google.protobuf'} & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_without_the_package_the_error_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delitem(sys.modules, "frictus_hardware.nidaq.session", raising=False)
    monkeypatch.setitem(sys.modules, "nidaqmx", None)
    config = wiring()
    rig = NiRig(config, conversion(config), FingerTouch(SimulatedConfig()))
    with pytest.raises(DriverMissingError, match=r"pip install .*frictus\[ni\]"):
        rig.open()
