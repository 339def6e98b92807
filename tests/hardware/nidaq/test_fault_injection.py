"""Every fault at a random moment: typed, the output safe, and the rig opens again."""

from contextlib import ExitStack

import grpc
import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from tests.hardware.nidaq import bench as benches
from tests.hardware.nidaq.bench import BenchMaker
from tests.hardware.nidaq.fake_server import Fault

from frictus_hardware.arrays import FloatArray
from frictus_hardware.base import Exchange
from frictus_hardware.errors import (
    ConfigError,
    DeviceLostError,
    HardwareError,
    LinkLostError,
    StreamLostError,
    TransientError,
    UnderrunError,
)
from frictus_hardware.nidaq.assembly import reset
from frictus_hardware.nidaq.backend import NiRig
from frictus_hardware.nidaq.config import Inputs
from frictus_hardware.nidaq.driver import UnlistedFaultError

READ, WRITE, COUNT = "ReadAnalogF64", "WriteAnalogF64", "GetReadAttributeUInt64"
LOST: list[tuple[int, type[HardwareError]]] = [
    *((code, UnderrunError) for code in (-200290, -200018, -200621)),
    *((code, StreamLostError) for code in (-200279, -200361)),
    *((code, DeviceLostError) for code in (-88709, -88710, -50405, -200045, -200088)),
    (-200561, ConfigError),
    (-209999, UnlistedFaultError),
]
BLOCK = 100


def run(rig: NiRig, rng: np.random.Generator, n_blocks: int = 60) -> None:
    """Drive as hard as allowed, until something goes wrong."""
    for _ in range(n_blocks):
        rig.exchange(rng.uniform(-75.0, 75.0, BLOCK))


def patient(rig: NiRig, drive_v: FloatArray) -> Exchange:
    """Offer the same block again after transient faults, as the rig's daemon does."""
    while True:
        try:
            return rig.exchange(drive_v)
        except TransientError:
            pass


@pytest.mark.parametrize(("code", "kind"), LOST)
def test_a_lost_stream_or_device_is_typed_and_the_output_at_zero(
    make_bench: BenchMaker, rng: np.random.Generator, code: int, kind: type[HardwareError]
) -> None:
    bench = make_bench()
    rpc = str(rng.choice([READ, WRITE, COUNT]))
    bench.server.plan(Fault(code, rpc, at_sample=int(rng.integers(1, 2_000))))
    with bench.rig as rig:
        rig.arm()
        with pytest.raises(kind, match=f"{code}.*The output is at 0 V") as raised:
            run(rig, rng)
        assert type(raised.value) is kind
        assert bench.device.output_v == 0.0
        assert rig.health() == str(raised.value)
        rig.stop(0.01)
        with pytest.raises(kind):  # it lasts
            rig.exchange(np.zeros(BLOCK))
        with pytest.raises(kind):
            rig.arm()
    with rig:
        assert rig.exchange(np.zeros(BLOCK)).first_sample == 0
        assert rig.health() is None


@pytest.mark.parametrize("status", [grpc.StatusCode.UNAVAILABLE, "hang"])
def test_a_lost_link_is_typed_and_says_that_the_output_may_be_live(
    make_bench: BenchMaker,
    rng: np.random.Generator,
    status: grpc.StatusCode | str,
) -> None:
    bench = make_bench(deadline_s=2.0 if status == "hang" else 20.0)
    with bench.rig as rig:
        rig.arm()
        run(rig, rng, 10)
        bench.server.plan(Fault(status, str(rng.choice([READ, WRITE, COUNT]))))
        bench.server.plan(Fault(status, "ClearTask", times=1_000))
        with pytest.raises(LinkLostError, match="MAY STILL BE LIVE"):
            run(rig, rng)
        assert bench.device.output_v != 0.0  # nobody could tell the device
    bench.server.servicer.faults.clear()
    reset(rig.config)
    assert bench.device.output_v == 0.0
    with rig:
        rig.exchange(np.zeros(BLOCK))


def test_a_killed_server_is_a_lost_link(
    make_bench: BenchMaker, rng: np.random.Generator
) -> None:
    bench = make_bench()
    with bench.rig as rig:
        rig.arm()
        run(rig, rng, 10)
        bench.server.kill()
        with pytest.raises(LinkLostError, match=bench.server.address):
            run(rig, rng)
    with pytest.raises(LinkLostError, match="cannot be reached"):
        rig.open()
    with pytest.raises(LinkLostError, match="cannot be reached"):
        reset(rig.config)


def test_a_link_that_is_lost_while_closing_is_not_kept_secret(
    make_bench: BenchMaker, rng: np.random.Generator
) -> None:
    bench = make_bench()
    bench.rig.open()
    bench.rig.arm()
    run(bench.rig, rng, 10)
    bench.server.kill()
    with pytest.raises(LinkLostError, match="MAY STILL BE LIVE"):
        bench.rig.close()
    bench.rig.close()
    assert bench.rig.health() == "not open"


def test_a_device_that_is_reset_by_another_is_lost(
    make_bench: BenchMaker, rng: np.random.Generator
) -> None:
    bench = make_bench()
    with bench.rig as rig:
        rig.arm()
        run(rig, rng, 10)
        reset(rig.config)
        assert bench.device.output_v == 0.0
        with pytest.raises(DeviceLostError, match="reset"):
            run(rig, rng)
        assert bench.device.output_v == 0.0


def test_a_device_that_is_unplugged_is_lost_and_missing(
    make_bench: BenchMaker, rng: np.random.Generator
) -> None:
    bench = make_bench()
    with bench.rig as rig:
        rig.arm()
        run(rig, rng, 10)
        bench.device.present = False
        bench.device.fail(-88709)
        with pytest.raises(DeviceLostError, match="MAY STILL BE LIVE"):
            run(rig, rng)
    with pytest.raises(ConfigError, match="device = 'Dev1'"):
        rig.open()


def test_a_loop_that_comes_too_late_has_lost_the_stream(
    make_bench: BenchMaker, rng: np.random.Generator
) -> None:
    bench = make_bench()
    with bench.rig as rig:
        rig.arm()
        run(rig, rng, 10)
        bench.device.pass_time(rig.config.device_lead_samples + 1)
        with pytest.raises(StreamLostError, match="ran dry"):
            run(rig, rng)
        assert bench.device.output_v == 0.0


def test_a_reset_silences_what_an_on_demand_zero_cannot(
    make_bench: BenchMaker, rng: np.random.Generator
) -> None:
    bench = make_bench()
    with bench.rig as rig:
        rig.arm()
        run(rig, rng, 10)
        bench.server.plan(Fault(-200290, READ))
        bench.server.plan(Fault(-50103, "WriteAnalogScalarF64"))
        with pytest.raises(StreamLostError, match="The output is at 0 V"):
            run(rig, rng)
        assert bench.device.output_v == 0.0
        assert bench.device.resets == 2


def test_transient_faults_are_resumed_without_losing_a_sample(
    make_bench: BenchMaker, rng: np.random.Generator
) -> None:
    bench = make_bench(record=True)
    planned = 30
    for _ in range(planned):
        read = bool(rng.random() < 0.5)
        bench.server.plan(
            Fault(
                int(rng.choice([-200284, -200292])),
                READ if read else WRITE,
                at_sample=int(rng.integers(1, 6_000)),
                partial=int(rng.integers(0, 20)),
            )
        )
    with bench.rig as rig:
        rig.arm()
        handed = [np.zeros(rig.info.lead_samples)]
        force_n = []
        for _ in range(70):
            got = patient(rig, rng.uniform(-75.0, 75.0, BLOCK))
            assert got.overrun_samples == 0
            handed.append(got.applied_v)
            force_n.append(got.force_n)
        assert not bench.server.servicer.faults
        assert 0 < rig.transient_faults <= planned  # a partial read goes on by itself
        played_v = bench.device.played_v * rig.config.amplifier_gain
        np.testing.assert_array_equal(played_v, np.concatenate(handed)[: played_v.size])
        x_n = np.concatenate(force_n)[:, 0]
        np.testing.assert_allclose(x_n, 1e-4 * np.arange(x_n.size), atol=1e-9)


def test_a_block_given_up_after_a_transient_fault_counts_as_overrun(
    make_bench: BenchMaker,
) -> None:
    bench = make_bench()
    with bench.rig as rig:
        rig.arm()
        rig.exchange(np.full(BLOCK, 10.0))
        bench.server.plan(Fault(-200284, READ))
        with pytest.raises(TransientError):
            rig.exchange(np.full(BLOCK, 20.0))
        rig.stop(0.01)
        play = rig.next_play_sample + BLOCK
        got = rig.exchange(np.zeros(50))
        assert got.overrun_samples == BLOCK
        assert got.first_sample == 2 * BLOCK
        assert got.play_sample == play


def test_a_clock_that_stands_still_ends_at_zero_when_closed(
    make_bench: BenchMaker, rng: np.random.Generator
) -> None:
    bench = make_bench()
    with bench.rig as rig:
        rig.arm()
        run(rig, rng, 10)
        bench.server.plan(Fault(-200284, READ, times=1_000))
        for _ in range(5):
            with pytest.raises(TransientError, match="in time"):
                rig.exchange(np.full(BLOCK, 70.0))
    assert bench.device.output_v == 0.0


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"device": "Dev7"}, "device = 'Dev7'"),
        ({"output": "ao9"}, "output = 'ao9'"),
        ({"monitor": Inputs(("ai77",))}, r"monitor: channels = \['ai77'\]"),
        ({"sample_rate_hz": 50_000.0}, "sample_rate_hz = 50000 for 10 channels"),
    ],
)
def test_what_does_not_fit_the_device_names_its_line(
    make_bench: BenchMaker, changes: dict[str, object], line: str
) -> None:
    bench = make_bench(**changes)
    with pytest.raises(ConfigError, match=line):
        bench.rig.open()
    assert not bench.device.tasks


def test_a_lead_that_the_device_cannot_take_is_refused(make_bench: BenchMaker) -> None:
    bench = make_bench()
    bench.server.plan(Fault(-200292, WRITE, partial=50))
    with pytest.raises(ConfigError, match="lead_ms = 30: the output took 50 of 400"):
        bench.rig.open()
    assert not bench.device.tasks
    with bench.rig as rig:
        rig.exchange(np.zeros(BLOCK))


FAILURES = st.sampled_from(
    [-200284, -200292, *(code for code, _ in LOST), grpc.StatusCode.UNAVAILABLE]
)
FAULTS = st.builds(
    Fault,
    failure=FAILURES,
    rpc=st.sampled_from(["", READ, WRITE, COUNT, "WriteAnalogScalarF64", "StopTask"]),
    at_sample=st.integers(0, 1_200),
    partial=st.integers(0, 50),
)


@given(faults=st.lists(FAULTS, max_size=6), seed=st.integers(0, 2**32 - 1))
@settings(
    max_examples=6,
    deadline=None,
    phases=[Phase.generate],
    suppress_health_check=[HealthCheck.too_slow],
)
def test_no_sequence_of_faults_raises_anything_untyped_or_leaves_the_output_live_in_silence(
    faults: list[Fault], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    with ExitStack() as stack:
        bench = benches.make_bench(stack)
        rig = bench.rig
        told = ""
        for fault in faults:
            bench.server.plan(fault)
        for _ in range(3):
            try:
                with rig:
                    told = ""  # opening has put the output to zero
                    rig.arm()
                    for _ in range(14):
                        patient(rig, rng.uniform(-75.0, 75.0, BLOCK))
            except HardwareError as error:
                told += str(error)
            assert bench.device.output_v == 0.0 or "MAY STILL BE LIVE" in told
        bench.server.servicer.faults.clear()
        with rig:
            rig.exchange(np.zeros(BLOCK))
        assert bench.device.output_v == 0.0
