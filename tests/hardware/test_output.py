"""The output queue against a model that remembers every sample."""

import numpy as np
import pytest

from frictus_hardware.output import OutputQueue

LEAD = 40
RETURN = 50


@pytest.mark.parametrize("holds", [False, True])
def test_plays_what_was_handed_over_in_time(holds: bool, rng: np.random.Generator) -> None:
    queue = OutputQueue(400, holds, RETURN)
    queue.write(0, np.zeros(LEAD), 0)
    expected = np.zeros(4_000)
    play, now, last = LEAD, 0, 0.0
    returned, held = RETURN, 0.0
    for _ in range(60):
        n_samples = int(rng.integers(1, 30))
        now = max(now + int(rng.integers(0, 45)), play - LEAD)  # now and then too late
        block = rng.standard_normal(n_samples)
        late, plays = queue.write(play, block, now)
        assert late == min(max(now - play, 0), n_samples)
        if late:
            returned, held = 0, last
        for n in range(n_samples):
            share = min((returned := returned + (n >= late)) / RETURN, 1.0)
            expected[play + n] = held + share * (block[n] - held) if n >= late else last
        np.testing.assert_allclose(plays, expected[play : play + n_samples], atol=1e-12)
        if holds and late < n_samples:
            last = float(plays[-1])
        play += n_samples
        expected[play:] = last
        recent = max(play - 300, 0)
        np.testing.assert_allclose(
            queue.read(recent, play + 20 - recent), expected[recent : play + 20], atol=1e-12
        )
        now = max(now, play - LEAD)


@pytest.mark.parametrize("skipped", [0, 7])
def test_a_stop_while_it_comes_back_ends_at_zero(skipped: int) -> None:
    queue = OutputQueue(400, True, RETURN)
    queue.write(0, np.full(20, 10.0), 0)
    queue.write(20 + skipped, np.full(20, -10.0), 25)  # late, or after samples that were lost
    queue.ramp(30, 5)
    queue.write(40 + skipped, np.zeros(20), 30)
    assert np.any(queue.read(0, 30))
    assert not np.any(queue.read(35, 100))


def test_ramp_ends_at_zero_and_drops_the_rest() -> None:
    queue = OutputQueue(400, True, RETURN)
    queue.write(0, np.full(100, 10.0), 0)
    queue.ramp(20, 30)
    out = queue.read(0, 150)
    assert np.all(out[:20] == 10.0)
    np.testing.assert_allclose(out[20:50], 10.0 * (1.0 - np.arange(1, 31) / 30.0))
    assert not np.any(out[49:])


def test_a_ramp_longer_than_the_queue_ends_with_it() -> None:
    queue = OutputQueue(400, True, RETURN)
    queue.write(0, np.full(20, 10.0), 0)
    queue.ramp(10, 100)
    out = queue.read(0, 50)
    assert np.all(np.diff(out) <= 0.0)
    assert out[19] == 0.0
    assert not np.any(out[19:])


def test_a_dry_queue_holds_or_falls_to_zero() -> None:
    for holds, idle in ((True, 7.0), (False, 0.0)):
        queue = OutputQueue(100, holds, RETURN)
        queue.write(0, np.array([5.0, 6.0, 7.0]), 0)
        np.testing.assert_array_equal(queue.read(0, 5), [5.0, 6.0, 7.0, idle, idle])
        queue.settle(10_000)  # long after
        queue.ramp(10_000, 50)
        assert np.all(queue.read(9_950, 50) == idle)
        assert not np.any(queue.read(10_000, 50))


def test_remembers_what_was_played_before() -> None:
    queue = OutputQueue(100, True, RETURN, past=np.arange(1.0, 6.0))
    queue.write(0, np.zeros(3), 0)
    np.testing.assert_array_equal(queue.read(-5, 8), [1.0, 2.0, 3.0, 4.0, 5.0, 0.0, 0.0, 0.0])
