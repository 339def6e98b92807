"""Bode plots: every sweep of one condition, coloured by its order, and the fit."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator, StrMethodFormatter
from numpy.typing import NDArray

from frictus_hardware.arrays import ComplexArray, FloatArray
from frictus_service.identification.documents import ConditionFit, ParticipantResult
from frictus_service.identification.fit.normal_equations import Law
from frictus_service.identification.fit.transfer_functions import (
    first_order,
    mass_spring_damper,
)
from frictus_service.identification.observation.response import TrialObservations
from frictus_service.identification.report.html import FIT, GRID, ORDER

MOST_SHOWN = 12
"""Sweeps beyond share the last colour."""
_FINE = 200
MARGINS = {"bottom": 0.1, "top": 0.94, "wspace": 0.25, "hspace": 0.1}


@dataclass(frozen=True, slots=True)
class Points:
    """Responses of a condition, thirds of a sweep averaged; arrays of shape (n,)."""

    sweep: NDArray[np.int64]
    tone_hz: FloatArray
    friction: ComplexArray
    mobility: ComplexArray


def points_of(observations: Sequence[TrialObservations], condition: ConditionFit) -> Points:
    """Return what was measured in a condition."""
    trials = [
        item.rows
        for item in observations
        if item.valid
        and item.rows.tone_hz.size
        and item.info.participant == condition.participant
        and item.info.speed_mm_s == condition.speed_mm_s
        and item.info.force_n == condition.force_n
    ]
    parts = []
    for rows in trials:
        keys = np.column_stack([rows.sweep, rows.tone_hz])
        unique, group = np.unique(keys, axis=0, return_inverse=True)
        count = np.bincount(group.ravel())
        means = [
            (
                np.bincount(group.ravel(), value.real)
                + 1j * np.bincount(group.ravel(), value.imag)
            )
            / count
            for value in (rows.friction_response, rows.mobility)
        ]
        parts.append((unique, *means))
    keys = np.concatenate([part[0] for part in parts])
    return Points(
        keys[:, 0].astype(np.int64),
        keys[:, 1],
        np.concatenate([part[1] for part in parts]),
        np.concatenate([part[2] for part in parts]),
    )


def bode(
    points: Points,
    condition: ConditionFit,
    participant: ParticipantResult,
    mobility_highest_hz: float,
) -> Figure:
    """Draw friction response and mobility of one condition, magnitude over phase.

    Parameters
    ----------
    points : Points
        Responses with intervals.
    condition : ConditionFit
        The one that is drawn.
    participant : ParticipantResult
        Its delays belong to the fits.
    mobility_highest_hz : float
        Up to there the mobility was fitted.
    """
    panels = _panels(points, condition, participant, mobility_highest_hz)
    # Laid out by hand: finding the margins takes longer than drawing.
    figure = Figure(figsize=(4.9 * len(panels) + 0.8, 5.4))
    axes = figure.subplots(2, len(panels), sharex=True, squeeze=False)
    figure.subplots_adjust(
        left=0.75 / figure.get_figwidth(), right=1.0 - 0.6 / figure.get_figwidth(), **MARGINS
    )
    last = min(int(points.sweep.max()), MOST_SHOWN - 1)
    norm = BoundaryNorm(np.arange(-0.5, last + 1.5), ORDER.N)
    tones = np.geomspace(points.tone_hz.min(), points.tone_hz.max(), _FINE)
    for panel, column in zip(panels, axes.T, strict=True):
        _draw(column, points, panel.measured, norm)
        fitted = panel.fit(tones)
        phase = np.degrees(np.unwrap(np.angle(fitted)))
        used = tones <= panel.highest_hz
        for part, look in ((used, "-"), (~used, ":")):
            column[0].plot(tones[part], np.abs(fitted[part]), look, color=FIT, lw=2)
            column[1].plot(tones[part], phase[part], look, color=FIT, lw=2)
        column[0].set_ylabel(panel.label)
        column[0].set_title(panel.title, loc="left")
    bar = figure.colorbar(
        ScalarMappable(norm, ORDER),
        ax=axes.ravel().tolist(),
        ticks=range(last + 1),
        fraction=0.25 / figure.get_figwidth(),
        pad=0.02,
    )
    bar.set_label("sweep, in order of time")
    return figure


@dataclass(frozen=True, slots=True)
class _Panel:
    """One response: what was measured, and what was fitted, at the measured delay."""

    title: str
    label: str
    measured: ComplexArray
    law: Law
    values: tuple[float, ...]
    delay_s: float
    highest_hz: float

    def fit(self, tones: FloatArray) -> ComplexArray:
        logs = np.repeat(np.log([self.values]), tones.size, axis=0)
        response, _ = self.law(logs, tones)
        delayed: ComplexArray = response * np.exp(-2j * np.pi * tones * self.delay_s)
        return delayed


def _panels(
    points: Points,
    condition: ConditionFit,
    participant: ParticipantResult,
    mobility_highest_hz: float,
) -> list[_Panel]:
    out = []
    friction, skin = condition.friction, condition.mobility
    if friction is not None and participant.friction is not None:
        out.append(
            _Panel(
                "Friction",
                "N per unit of drive",
                points.friction,
                first_order,
                (friction.gain_n.value, friction.cutoff_hz.value),
                participant.friction.delay_s.value,
                np.inf,
            )
        )
    if skin is not None and participant.mobility is not None:
        out.append(
            _Panel(
                "Skin",
                "m/s per N",
                points.mobility,
                mass_spring_damper,
                (skin.mass_kg.value, skin.damping_n_s_m.value, skin.stiffness_n_m.value),
                participant.mobility.delay_s.value,
                mobility_highest_hz,
            )
        )
    return out


def _draw(
    column: NDArray[np.object_], points: Points, response: ComplexArray, norm: BoundaryNorm
) -> None:
    magnitude, phase = column
    colour = np.minimum(points.sweep, MOST_SHOWN - 1)
    look = {"c": colour, "cmap": ORDER, "norm": norm, "s": 14, "lw": 0, "alpha": 0.8}
    magnitude.scatter(points.tone_hz, np.abs(response), **look)
    phase.scatter(points.tone_hz, np.degrees(np.angle(response)), **look)
    magnitude.set_xscale("log")
    magnitude.set_yscale("log")
    for axis in (magnitude.xaxis, magnitude.yaxis):
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axis.set_minor_locator(NullLocator())
    phase.set_xlabel("frequency, Hz")
    phase.set_ylabel("phase, °")
    _grid(magnitude)
    _grid(phase)


def _grid(axes: Axes) -> None:
    axes.grid(**GRID)
