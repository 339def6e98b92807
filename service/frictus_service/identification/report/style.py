"""Colours that all figures share."""

from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.colors import ListedColormap

ORDER = mpl.colormaps["viridis"]
"""Of what comes in an order: sweeps, speeds."""
FIT = "#c1272d"
GRID: dict[str, Any] = {"alpha": 0.3, "lw": 0.6}


def people(n: int) -> list[tuple[float, float, float, float]]:
    """Return a colour per participant."""
    colours = mpl.colormaps["tab10" if n <= 10 else "tab20"]
    assert isinstance(colours, ListedColormap)
    return [tuple(colours(i % colours.N)) for i in range(n)]  # type: ignore[misc]


def ordered(n: int) -> list[tuple[float, float, float, float]]:
    """Return a colour per level of something ordered."""
    return [tuple(colour) for colour in ORDER(np.linspace(0.05, 0.9, n))]
