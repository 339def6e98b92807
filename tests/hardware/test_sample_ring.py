"""The ring of samples, against a list that forgets nothing."""

import numpy as np

from frictus_hardware.output import SampleRing


def test_a_ring_holds_what_was_written_last_wherever_it_wraps(
    rng: np.random.Generator,
) -> None:
    ring, began = SampleRing(64), 1_000
    signal = np.zeros(40_000)
    at = -200  # what played before the first sample
    while at < 35_000:
        n = int(rng.integers(0, 65))
        values = rng.normal(size=n) if rng.random() < 0.7 else float(rng.normal())
        ring.write(at, n, values)
        signal[began + at : began + at + n] = values
        at += n
        back = int(rng.integers(0, 65))
        found = ring.read(at - back, back)
        np.testing.assert_array_equal(found, signal[began + at - back : began + at])


def test_what_was_read_stays_as_it_was() -> None:
    ring = SampleRing(8)
    ring.write(0, 4, [1.0, 2.0, 3.0, 4.0])
    found = ring.read(0, 4)
    ring.write(0, 4, 0.0)
    np.testing.assert_array_equal(found, [1.0, 2.0, 3.0, 4.0])
