"""Leads of 2 to 20 ms on the fake device: exact while the loop is not later than they are."""

import numpy as np
import pytest
from tests.hardware.nidaq.bench import BenchMaker
from tests.hardware.nidaq.fake_device import NOT_FULL, USB

from frictus_hardware.arrays import FloatArray
from frictus_hardware.base import Exchange
from frictus_hardware.errors import ConfigError, UnderrunError
from frictus_hardware.nidaq.devices import mismatches, survey

LEADS_MS = [2.0, 5.0, 10.0, 20.0]
BLOCK = 100
"""5 ms, longer than the shortest lead: its pieces are shorter."""
START = 400


def joined(blocks: list[Exchange]) -> tuple[FloatArray, FloatArray]:
    """Return what was applied and what was monitored, by device sample."""
    n_samples = blocks[-1].play_sample + BLOCK
    applied = np.zeros(n_samples)
    for block in blocks:
        applied[block.play_sample : block.play_sample + BLOCK] = block.applied_v
    return applied, np.concatenate([block.voltage_v for block in blocks])


@pytest.mark.parametrize("lead_ms", LEADS_MS)
def test_what_is_handed_over_plays_one_lead_later_however_late_the_loop_is_within_it(
    make_bench: BenchMaker, rng: np.random.Generator, lead_ms: float
) -> None:
    bench = make_bench(lead_ms=lead_ms)
    blocks = []
    with bench.rig as rig:
        lead, in_device = round(20 * lead_ms), rig.config.device_lead_samples
        assert rig.info.lead_samples == lead
        rig.arm()
        late = 0
        for _ in range(60):
            got = rig.exchange(rng.uniform(-75.0, 75.0, BLOCK))
            assert got.play_sample == got.first_sample + lead
            assert got.margin_samples == in_device - late
            blocks.append(got)
            late = int(rng.integers(0, min(in_device, BLOCK)))
            bench.device.pass_time(late)
    applied, voltage = joined(blocks)
    np.testing.assert_allclose(voltage, applied[: voltage.size], atol=1e-9)
    assert blocks[0].first_sample == 0
    assert np.flatnonzero(voltage)[0] == lead


@pytest.mark.parametrize("lead_ms", LEADS_MS)
def test_later_than_what_is_in_the_device_it_is_an_underrun_at_0_v(
    make_bench: BenchMaker, lead_ms: float
) -> None:
    bench = make_bench(lead_ms=lead_ms)
    with bench.rig as rig:
        rig.arm()
        rig.exchange(np.full(BLOCK, 30.0))
        bench.device.pass_time(rig.config.device_lead_samples)
        rig.exchange(np.full(BLOCK, 30.0))
        bench.device.pass_time(rig.config.device_lead_samples + 1)
        with pytest.raises(UnderrunError, match=r"ran dry.*The output is at 0 V"):
            rig.exchange(np.full(BLOCK, 30.0))
        assert bench.device.output_v == 0.0


@pytest.mark.parametrize("lead_ms", LEADS_MS)
def test_a_stop_ramps_what_is_not_in_the_device_yet(
    make_bench: BenchMaker, lead_ms: float
) -> None:
    bench = make_bench(record=True, lead_ms=lead_ms)
    with bench.rig as rig:
        config = rig.config
        rig.arm()
        for _ in range(10):
            rig.exchange(np.full(BLOCK, 50.0))
        stopped = bench.device.now
        rig.stop(0.02)
        for _ in range(10):
            rig.exchange(np.zeros(BLOCK))
        driven = np.flatnonzero(bench.device.played_v)
        assert driven[-1] < stopped + config.lead_samples
        ramp = bench.device.played_v[stopped + config.device_lead_samples : driven[-1] + 2]
        assert np.all(np.diff(ramp) < 0.0), "no step where it stops"
        assert ramp[-1] == 0.0


@pytest.mark.parametrize("lead_ms", LEADS_MS)
@pytest.mark.parametrize("waits", [0, 150, 399])
def test_the_first_block_may_be_late_by_20_ms(
    make_bench: BenchMaker, lead_ms: float, waits: int
) -> None:
    bench = make_bench(lead_ms=lead_ms)
    with bench.rig as rig:
        bench.device.pass_time(waits)
        first = rig.exchange(np.zeros(BLOCK))
        assert first.first_sample == first.overrun_samples == 0
        ahead = START - rig.config.device_lead_samples
        late = max(waits - ahead, 0)
        assert first.margin_samples == rig.config.device_lead_samples - late
        still_late = max(late - BLOCK, 0)
        then = rig.exchange(np.zeros(BLOCK))
        assert then.margin_samples == rig.config.device_lead_samples - still_late


@pytest.mark.parametrize("lead_ms", LEADS_MS)
def test_it_closes_at_0_v_before_and_after_the_first_block(
    make_bench: BenchMaker, lead_ms: float
) -> None:
    bench = make_bench(lead_ms=lead_ms)
    with bench.rig as rig:
        assert rig.next_play_sample == rig.info.lead_samples
    assert bench.device.output_v == 0.0
    with bench.rig as rig:
        rig.arm()
        rig.exchange(np.full(BLOCK, 50.0))
    assert bench.device.output_v == 0.0
    assert not bench.device.tasks


def test_a_short_lead_grows(make_bench: BenchMaker) -> None:
    bench = make_bench(lead_ms=2.0)
    with bench.rig as rig:
        before = rig.exchange(np.zeros(BLOCK))
        in_device = rig.config.device_lead_samples
        rig.lengthen_lead(140)
        assert rig.next_play_sample == before.first_sample + BLOCK + 140
        rig.exchange(np.zeros(BLOCK))
        assert rig.exchange(np.zeros(BLOCK)).margin_samples == in_device + 100
        bench.device.pass_time(in_device + 100)
        assert rig.exchange(np.zeros(BLOCK)).margin_samples == 0
    with bench.rig as rig:  # as long when it is opened anew
        assert rig.exchange(np.zeros(BLOCK)).margin_samples == in_device + 100
        assert rig.exchange(np.zeros(BLOCK)).margin_samples == in_device + 100


@pytest.mark.parametrize("lead_ms", LEADS_MS)
def test_the_device_is_set_up_for_it(make_bench: BenchMaker, lead_ms: float) -> None:
    bench = make_bench(lead_ms=lead_ms)
    with bench.rig as rig:
        (output,) = [task for task in bench.device.tasks.values() if task.kind == "ao"]
        assert not output.regenerates
        assert output.transfer == NOT_FULL
        assert output.buffer == rig.config.buffer_samples >= 2 * START


@pytest.mark.parametrize("lead_ms", LEADS_MS)
def test_on_usb_what_is_too_short_is_refused_and_the_rest_plays(
    make_bench: BenchMaker, lead_ms: float
) -> None:
    bench = make_bench(bus=USB, lead_ms=lead_ms)
    found = survey(bench.rig.config).facts
    assert found is not None
    wrong = [each for each in mismatches(bench.rig.config, found) if "lead_ms" in each]
    if lead_ms < 7.5:
        assert len(wrong) == 1
        assert "which is on USB: at least 5 ms accepted" in wrong[0]
        with pytest.raises(ConfigError, match=f"lead_ms = {lead_ms:g} .* on USB"):
            bench.rig.open()
        assert not bench.device.tasks
        return
    assert not wrong
    with bench.rig as rig:
        rig.arm()
        blocks = [rig.exchange(np.full(BLOCK, 20.0)) for _ in range(8)]
    applied, voltage = joined(blocks)
    np.testing.assert_allclose(voltage, applied[: voltage.size], atol=1e-9)
