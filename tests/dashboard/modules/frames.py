"""Frames as the service packs them."""

import struct
from typing import Any

import numpy as np

RATE_HZ = 20_000.0


def packed(
    data: np.ndarray[Any, Any],
    lost: int = 0,
    per_column: int = 80,
    run: int = 7,
    first_sample: int = 1_000,
) -> Any:
    """Return a min/max frame of `force`; data of shape (channels, 2, columns)."""
    channels, _, columns = data.shape
    header = struct.pack(
        "<HHHHIIQQdII8x",
        *(1, 1, channels, 64, run, columns),
        *(first_sample, lost, RATE_HZ, per_column, 1),
    )
    return list(header + data.astype("<f4").tobytes())
