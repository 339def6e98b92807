"""The reach of a table costs what its content at a speed is worth, and is what it was."""

import time

import numpy as np
import pytest

from frictus_service.synthesis.reach import _table_reach

N_POINTS, N_ROWS = 200_000, 60


def reach(points: np.ndarray, rate: float) -> tuple[float, float, float]:
    """Return CPU time, s, least and greatest drive; the rows go 12 to the octave from 1."""
    whole = np.array([0, 0, N_POINTS, N_ROWS])
    low, high, size = np.zeros((3, 1))
    began_s = time.thread_time()
    _table_reach(
        points,
        whole,
        np.array([0.3]),
        np.array([rate]),
        0.0,
        np.array([0.9]),
        0,
        low,
        high,
        size,
    )
    return time.thread_time() - began_s, float(low[0]), float(high[0])


def test_rows_without_fine_detail_are_read_less_densely() -> None:
    at = 2.0 * np.pi * np.arange(-1, N_POINTS + 2) / N_POINTS
    # What the row for 16 times the speed may hold: 256 points per cycle.
    points = np.tile(np.sin(at * (N_POINTS // 256)), (N_ROWS, 1)).ravel()
    reach(points, 1.0)  # compiled
    dense_s, *dense = min(reach(points, 1.0) for _ in range(3))
    sparse_s, *sparse = min(reach(points, 16.0) for _ in range(3))
    assert sparse == pytest.approx(dense, rel=1e-3)
    assert sparse_s < dense_s / 4.0
