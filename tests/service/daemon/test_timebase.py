"""The fit of samples to UTC, against clocks whose truth is known."""

import numpy as np
import pytest

from frictus_service.daemon.block_loop.timebase import Stamp, Timebase, UtcReading

RATE_HZ = 20_000.0
BLOCK = 100
START_NS = 1_795_000_000_000_000_000


class Host:
    """One machine: a UTC clock that may be stepped, read by several rigs."""

    def __init__(self, step_at_s: float, step_ns: int) -> None:
        self.step_at_ns = 1e9 * step_at_s
        self.step_ns = step_ns

    def utc_ns(self, true_ns: float) -> int:
        return int(START_NS + true_ns + (self.step_ns if true_ns >= self.step_at_ns else 0))


class SimulatedRig:
    """A device with a skewed clock, whose blocks are seen late by an ordinary process."""

    def __init__(
        self, host: Host, rng: np.random.Generator, skew_ppm: float, least_late_us: float
    ) -> None:
        self.host = host
        self.rng = rng
        self.per_sample_ns = 1e9 / RATE_HZ / (1.0 + 1e-6 * skew_ppm)
        self.began_ns = rng.uniform(0.0, 1e8)
        self.least_late_ns = 1e3 * least_late_us
        self.timebase = Timebase(RATE_HZ)
        self.end = 0

    def late_ns(self) -> float:
        tail = self.rng.exponential(80e3)
        if self.rng.random() < 0.01:
            tail += self.rng.uniform(0.0, 6e6)  # the process was held up
        return self.least_late_ns + tail

    def next_block(self) -> None:
        self.end += BLOCK
        seen_ns = self.began_ns + self.end * self.per_sample_ns + self.late_ns()
        before = seen_ns + self.rng.uniform(100.0, 500.0)
        after = before + self.rng.uniform(100.0, 500.0)
        reading = UtcReading(int(before), self.host.utc_ns(0.5 * (before + after)), int(after))
        self.timebase.observe(self.end, int(seen_ns), reading)
        self.timebase.fit()

    def sample_at(self, true_ns: float) -> float:
        return (true_ns - self.began_ns) / self.per_sample_ns

    def stamp_of_block(self, true_ns: float) -> Stamp | None:
        """Stamp an event in the newest block as a reader of the wire would."""
        sample = self.sample_at(true_ns)
        first = self.end - BLOCK
        if not first <= sample < self.end:
            return None
        stamp = self.timebase.stamp(first)
        ns = stamp.utc_ns + (sample - first) * self.timebase.ns_per_sample
        return Stamp(int(ns), stamp.uncertainty_ns)


def run(
    rng: np.random.Generator, seconds: float, step_at_s: float, step_ns: int
) -> tuple[list[tuple[int, int, float]], list[SimulatedRig]]:
    """Return (disagreement, sum of uncertainties, time) in ns, per event that both rigs saw."""
    host = Host(step_at_s, step_ns)
    skews = rng.choice([-50.0, 50.0], 2, replace=False)
    rigs = [SimulatedRig(host, rng, skew, rng.uniform(20.0, 150.0)) for skew in skews]
    seen: list[dict[int, Stamp]] = [{}, {}]
    for rig, stamps in zip(rigs, seen, strict=True):
        events_ns = 1e6 * np.arange(200, 1_000 * seconds, 1.7)
        for _ in range(round(seconds * RATE_HZ / BLOCK)):
            rig.next_block()
            first_ns = rig.began_ns + (rig.end - BLOCK) * rig.per_sample_ns
            low = np.searchsorted(events_ns, first_ns)
            high = np.searchsorted(events_ns, first_ns + BLOCK * rig.per_sample_ns)
            for event in range(int(low), int(high)):
                stamp = rig.stamp_of_block(float(events_ns[event]))
                if stamp is not None:
                    stamps[event] = stamp
    rows = []
    for event in seen[0].keys() & seen[1].keys():
        a, b = seen[0][event], seen[1][event]
        apart = abs(a.utc_ns - b.utc_ns)
        rows.append((apart, a.uncertainty_ns + b.uncertainty_ns, 1e6 * (200 + 1.7 * event)))
    return rows, rigs


def test_two_rigs_agree_within_their_uncertainties(rng: np.random.Generator) -> None:
    rows, rigs = run(rng, 30.0, 17.3, 250_000_000)
    apart, allowed, time_ns = np.array(rows).T
    assert len(rows) > 10_000
    assert np.mean(apart <= allowed) >= 0.95
    assert np.median(allowed) < 2e6, "each below 1 ms"
    around_step = np.abs(time_ns - 17.3e9) < 50e6
    assert np.count_nonzero(around_step) > 40
    assert np.all(apart[around_step] <= allowed[around_step])
    for rig in rigs:
        # Among some thousand blocks an unlucky round trip may look like a step, and back.
        assert rig.timebase.utc_steps in (1, 3)
        assert abs(abs(rig.timebase.skew_ppm) - 50.0) < 10.0


@pytest.mark.parametrize("skew_ppm", [0.0, 50.0])
@pytest.mark.parametrize("busy_ns", [0.0, 400_000.0])
def test_skew_is_known_as_well_as_is_said(
    rng: np.random.Generator, skew_ppm: float, busy_ns: float
) -> None:
    known, said = [], []
    for _ in range(10):
        rig = SimulatedRig(Host(1e9, 0), rng, skew_ppm, 50.0)
        assert rig.timebase.skew_uncertainty_ppm == 200.0
        busy_from, busy_to = np.sort(rng.integers(0, 5_000, 2))
        for block in range(5_000):
            # While the machine is busy even the least late block of a bin comes later.
            rig.least_late_ns = 50e3 + (busy_ns if busy_from <= block < busy_to else 0.0)
            rig.next_block()
            if block % 200 == 199:
                error_ppm = abs(rig.timebase.skew_ppm - skew_ppm)
                known.append(error_ppm <= rig.timebase.skew_uncertainty_ppm)
        said.append(rig.timebase.skew_uncertainty_ppm)
    assert np.mean(known) >= 0.95
    if not busy_ns:
        assert max(said) < 5.0, "and it says no more than it has to"


def test_uncertainty_covers_the_true_time(rng: np.random.Generator) -> None:
    host = Host(1e9, 0)
    rig = SimulatedRig(host, rng, 50.0, 100.0)
    inside = []
    for _ in range(4_000):
        rig.next_block()
        first = rig.end - BLOCK
        stamp = rig.timebase.stamp(first)
        true_ns = rig.began_ns + first * rig.per_sample_ns
        inside.append(abs(stamp.utc_ns - host.utc_ns(true_ns)) <= stamp.uncertainty_ns)
    assert np.mean(inside) >= 0.95


@pytest.mark.parametrize("step_ns", [-3_600_000_000_000, -20_000_000, 20_000_000])
def test_step_is_followed_at_once(rng: np.random.Generator, step_ns: int) -> None:
    rig = SimulatedRig(Host(5.0, step_ns), rng, 0.0, 50.0)
    steps = []
    for _ in range(1_500):
        rig.next_block()
        stamp = rig.timebase.stamp(rig.end - BLOCK)
        steps.append((rig.timebase.utc_steps, stamp.uncertainty_ns))
    counted = [n for n, _ in steps]
    assert max(counted) == 1
    carries = [u for n, u in steps[counted.index(1) :]]
    assert carries[0] >= abs(step_ns), "the block of the step says so"
    assert max(carries[4:]) < 1_000_000, "and those after it are sound again"


def test_slewing_is_not_a_step(rng: np.random.Generator) -> None:
    timebase = Timebase(RATE_HZ)
    for block in range(1, 2_000):
        seen = block * 5_000_000 + int(rng.exponential(50e3))
        slewed = int(1.0005 * seen)
        timebase.observe(block * BLOCK, seen, UtcReading(seen, START_NS + slewed, seen + 300))
        timebase.fit()
        stamp = timebase.stamp(block * BLOCK)
        assert abs(stamp.utc_ns - START_NS - 1.0005 * 5e6 * block) < 1e6
    assert timebase.utc_steps == 0


def test_reading_that_was_interrupted_is_not_taken(rng: np.random.Generator) -> None:
    timebase = Timebase(RATE_HZ)
    for block in range(1, 500):
        seen = block * 5_000_000
        held_up = 40_000_000 if block % 50 == 0 else 0
        reading = UtcReading(seen, START_NS + seen, seen + 300 + held_up)
        timebase.observe(block * BLOCK, seen, reading)
        timebase.fit()
        assert abs(timebase.stamp(block * BLOCK).utc_ns - START_NS - seen) < 50_000
    assert timebase.utc_steps == 0


def test_nothing_to_stamp_before_the_first_block() -> None:
    with pytest.raises(RuntimeError, match="no block"):
        Timebase(RATE_HZ).stamp(0)


@pytest.mark.parametrize("burst_ns", [0, 30_000_000])
@pytest.mark.parametrize("block", [20, 100])
def test_stamps_of_blocks_rise_though_the_fit_moves(
    rng: np.random.Generator, block: int, burst_ns: int
) -> None:
    """Blocks late together and busy stretches move the line by less than a block."""
    timebase = Timebase(RATE_HZ)
    stamps, seen = [], 0.0
    for number in range(1, 4_000):
        late_ns = rng.exponential(80e3) + (
            rng.uniform(0.0, 6e6) if rng.random() < 0.01 else 0.0
        )
        late_ns += burst_ns if number < 10 else 0.0
        late_ns += 400e3 if 1_000 < number < 2_000 else 0.0
        seen = max(seen + 20e3, number * block * 1e9 / RATE_HZ + late_ns)  # in order
        reading = UtcReading(int(seen), START_NS + int(seen), int(seen) + 300)
        timebase.observe(number * block, int(seen), reading)
        stamps.append(timebase.stamp((number - 1) * block).utc_ns)
        timebase.fit()
    steps = np.diff(stamps)
    assert np.all(steps > 0)
    # The line moves back, too: stamps of samples rise by `frictus.slewed_clock` alone.
    assert np.min(steps - block * 1e9 / RATE_HZ) < 0
