"""What has to be undone so that a finger feels the target, and what of it each mode undoes."""

from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from frictus.errors import ArgumentError
from frictus.model import Compensation
from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.friction import FrictionLaw, cutoff_hz, pole_zero_pairs
from frictus_hardware.physics.paths import MEASURED, ParallelPath
from frictus_hardware.physics.schedule import LawSchedule, SlidingConditions
from frictus_service.synthesis.path_compensation import demand_of
from frictus_service.synthesis.tables import TOP_HZ

SLOWEST_FELT_HZ: Final = 20.0
"""Textures are made good for a leak down to here without leaving the drive's range."""
PHASES_TOO: Final = 1.5
"""The inverse of a roll-off, or of a path, turns phases besides, and peaks may meet that did
not: by so much in the exponent the drive swings further than by the loudest tone alone, as
measured on the shipped textures."""
FORGET_HZ: Final = 0.25
"""Below this, what leaks away is not made good: a constant drive cannot be held."""


@dataclass(frozen=True, slots=True)
class CompensationRemark:
    """What is to be said of an effect.

    Attributes
    ----------
    effect : str
        Its id.
    rendered : bool
        Whether it is undone at all.
    text : str
        Why not, or within which limits.
    """

    effect: str
    rendered: bool
    text: str


@dataclass(frozen=True, slots=True)
class Ranges:
    """Where effects are followed; beyond, they hold still.

    Attributes
    ----------
    force_n : tuple of float
        Where the model was measured.
    x_mm : tuple of float
        The screen.
    minutes : tuple of float
        No session lasts longer; a drift goes on without end only in its equation.
    speed_mm_s : tuple of float
        All speeds, for a law confines them itself; or one alone, which is then taken for the
        finger's.
    """

    force_n: tuple[float, float] = (0.2, 0.6)
    x_mm: tuple[float, float] = (0.0, 70.0)
    minutes: tuple[float, float] = (0.0, 30.0)
    speed_mm_s: tuple[float, float] = (-np.inf, np.inf)

    def confine(self, circumstances: SlidingConditions) -> SlidingConditions:
        """Return the nearest circumstances within the ranges."""
        return replace(
            circumstances,
            speed_mm_s=np.clip(circumstances.speed_mm_s, *self.speed_mm_s),
            normal_force_n=np.clip(circumstances.normal_force_n, *self.force_n),
            position_mm=np.clip(circumstances.position_mm, *self.x_mm),
            minutes=np.clip(circumstances.minutes, *self.minutes),
        )

    def everywhere(self, speed_mm_s: tuple[float, float]) -> SlidingConditions:
        """Return a grid over all circumstances, shape (9, 5, 9, 2, 5)."""
        return SlidingConditions(
            *np.meshgrid(
                np.linspace(*speed_mm_s, 9),
                np.linspace(*self.force_n, 5),
                np.linspace(*self.x_mm, 9),
                (-1.0, 1.0),
                np.linspace(*self.minutes, 5),
                indexing="ij",
            )
        )


@dataclass(frozen=True, slots=True)
class Inverse:
    """A law with effects, as far as it can be undone. A law alone is undone as it stands.

    Attributes
    ----------
    law : FrictionLaw
        Without effects.
    schedule : LawSchedule
        How gain and cutoff vary besides.
    excess_order : float
        Of the roll-off, beyond the first.
    leak_hz : float
        Corner below which the drive is lost; 0 for none.
    drive_table : ndarray, shape (n,)
        Over the drive that friction shall follow, even from 0 to 1, the drive that it takes;
        empty where they are the same.
    paths : tuple of ParallelPath
        Along which the drive acts besides.
    ranges : Ranges
        Of force and position for which it must hold.
    remarks : tuple of CompensationRemark
        What cannot be undone, and why.
    bounding : FrictionLaw
        A law of least gain and slowest cutoff, wherever, however and whenever. Scenes are
        compiled for it, so that one gain and one bias fit everywhere.
    swing : float
        How many times more than by the bounding law the drive swings about its bias.
    """

    law: FrictionLaw
    schedule: LawSchedule = LawSchedule()  # noqa: RUF009 - frozen
    excess_order: float = 0.0
    leak_hz: float = 0.0
    drive_table: FloatArray = field(default_factory=lambda: np.zeros(0))
    paths: tuple[ParallelPath, ...] = ()
    ranges: Ranges = Ranges()
    remarks: tuple[CompensationRemark, ...] = ()
    bounding: FrictionLaw = field(init=False)
    swing: float = field(init=False)

    def __post_init__(self) -> None:
        """Work out once what scenes and streams are compiled for."""
        bounding, swing = (self.law, 1.0) if self.plain else self._most_demanding()
        object.__setattr__(self, "bounding", bounding)
        object.__setattr__(self, "swing", swing)

    @property
    def not_rendered(self) -> dict[str, str]:
        """Why effects are not undone, by id."""
        return self._told(rendered=False)

    @property
    def limits(self) -> dict[str, str]:
        """Within which limits effects are undone, by id; those without limit are left out."""
        return self._told(rendered=True)

    def _told(self, rendered: bool) -> dict[str, str]:
        told: dict[str, str] = {}
        for remark in self.remarks:
            if remark.rendered == rendered:
                before = f"{told[remark.effect]}; " if remark.effect in told else ""
                told[remark.effect] = before + remark.text
        return told

    @property
    def plain(self) -> bool:
        """Whether there is nothing but the law."""
        return (
            self.schedule == LawSchedule()
            and self.excess_order == 0.0
            and self.leak_hz == 0.0
            and self.drive_table.size == 0
            and not self.paths
        )

    @property
    def pairs(self) -> tuple[tuple[float, float], ...]:
        """Zeros and poles of the roll-off beyond the first order, times the cutoff."""
        return pole_zero_pairs(self.excess_order)

    def along(self, circumstances: SlidingConditions) -> tuple[FloatArray, FloatArray]:
        """Return gain (N per unit of drive) and cutoff (Hz) in given circumstances."""
        confined = self.ranges.confine(circumstances)
        return (
            self.schedule.gain_n(self.law, confined),
            self.schedule.cutoff_hz(self.law, confined),
        )

    def _most_demanding(self) -> tuple[FrictionLaw, float]:
        """Return `bounding` and `swing`."""
        everywhere = self.ranges.everywhere(self.law.speed_range_mm_s)
        gain_n, cutoff_hz = self.along(everywhere)
        own = LawSchedule().cutoff_hz(self.law, everywhere)
        weakest, further = demand_of(self.paths, self.ranges.everywhere(MEASURED["speed_mm_s"]))
        slower = min(float((cutoff_hz / own).min()), 1.0)
        bounding = replace(
            self.law,
            gain_n=float(np.min(gain_n)) * weakest,
            cutoff_0_hz=self.law.cutoff_0_hz * slower,
            slope_hz_per_mm_s=self.law.slope_hz_per_mm_s * slower,
        )
        slowest = float(np.min(cutoff_hz))
        louder = float(np.hypot(1.0, TOP_HZ / slowest)) ** max(self.excess_order, 0.0)
        louder *= further
        return bounding, louder**PHASES_TOO * (1.0 + self.leak_hz / SLOWEST_FELT_HZ)


Invertible = FrictionLaw | Inverse


def as_inverse(law: Invertible) -> Inverse:
    """Return an inverse as it is, and that of a law without effects."""
    return law if isinstance(law, Inverse) else Inverse(law)


BEYOND_HZ: Final = 1e5
"""A cutoff so high that its inverse is a plain gain up to any frequency that is felt."""


def uncompensated(law: FrictionLaw) -> FrictionLaw:
    """Return a law whose inverse is a plain gain."""
    return FrictionLaw(law.gain_n, BEYOND_HZ, 0.0, law.speed_range_mm_s)


def fixed_at(law: FrictionLaw, speed_mm_s: float) -> FrictionLaw:
    """Return a law whose inverse does not follow the speed."""
    cutoff = float(cutoff_hz(law, speed_mm_s))
    return FrictionLaw(law.gain_n, cutoff, 0.0, law.speed_range_mm_s)


def inverse_in_mode(inverse: Inverse, compensation: Compensation) -> Inverse:
    """Return what is inverted in a compensation mode instead of the model.

    Scenes stay compiled for the model: gain and bias do not depend on the mode, so that what is
    felt in two modes differs by the compensation alone. Above a speed that is fixed the drive
    may then leave its range: it is clipped, and counted.

    Parameters
    ----------
    inverse : Inverse
        Of the model in force.
    compensation : Compensation
        The mode. With `fixed` all that depends on the speed is taken at the fixed one; effects
        of force, place, direction and time are followed as before. With `none` effects are not
        undone either.

    Raises
    ------
    ArgumentError
        If the fixed speed is outside of what the model was measured for: its cutoff there would
        silently be that of another speed.
    """
    match compensation.mode:
        case "model":
            return inverse
        case "none":
            return Inverse(uncompensated(inverse.law))
        case "fixed":
            return _fixed(inverse, compensation.speed_mm_s)


def _fixed(inverse: Inverse, speed_mm_s: float | None) -> Inverse:
    slowest, fastest = inverse.law.speed_range_mm_s
    if speed_mm_s is None or not slowest <= speed_mm_s <= fastest:
        raise ArgumentError(
            f"speed_mm_s: {speed_mm_s}; the model holds from {slowest:g} to {fastest:g} mm/s: "
            "fix a speed within"
        )
    ranges = replace(inverse.ranges, speed_mm_s=(speed_mm_s, speed_mm_s))
    return replace(inverse, law=fixed_at(inverse.law, speed_mm_s), ranges=ranges)
