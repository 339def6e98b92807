"""What is true of rig and finger, beyond the paper's law."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from tests.blind.generator.rolloff import FIRST_ORDER, Rolloff
from tests.blind.generator.transfer import Rational, mount

FloatArray = NDArray[np.float64]

THE_MOUNT = mount()


@dataclass(frozen=True, slots=True)
class Moment:
    """When and how friction acts; arrays of one shape but `minutes`.

    Attributes
    ----------
    speed_mm_s : ndarray
        Kept at 20 to 100, as the paper's law is.
    normal_force_n, position_mm : ndarray
    direction : ndarray
        +1 left to right, -1 right to left, in between where it turns.
    minutes : float
        Since the person's first trial.
    """

    speed_mm_s: FloatArray
    normal_force_n: FloatArray
    position_mm: FloatArray
    direction: FloatArray
    minutes: float


@dataclass(frozen=True, slots=True)
class Section:
    """A factor 1 + depth times a band pass in the friction response."""

    frequency_hz: float
    quality: float
    depth: Callable[[Moment], FloatArray]


@dataclass(frozen=True, slots=True)
class Shelf:
    """What leaks: s + (1 - share) w over s + w, on the drive fraction."""

    corner_hz: float
    share: float


@dataclass(frozen=True, slots=True)
class Echo:
    """What comes a second time: a share of the drive fraction, late."""

    delay_s: float
    share: float


@dataclass(frozen=True, slots=True)
class StickSlip:
    """A saw-tooth over the way: peak amplitude at rest, and how it goes with speed."""

    amplitude_n: float
    fading_mm_s: float = 20.0
    period_mm: float = 2.0


@dataclass(frozen=True, slots=True)
class Relaxation:
    """Skin that sticks until a force breaks it loose: a spring that the finger loads.

    How much force breaks loose falls with speed, and how far the finger goes until then is that
    force over the stiffness; the slip takes its time. Cycles differ, as contacts do.

    Attributes
    ----------
    amplitude_n : float
        Half of the force that breaks loose, at rest.
    stiffness_n_per_mm : float
        Of the skin along the screen.
    fading_mm_s : float
        Speed at which the force has fallen to 1/e.
    slip_s : float
        That a slip takes.
    scatter : float
        Standard deviation of the logarithm of a cycle's force.
    """

    amplitude_n: float
    stiffness_n_per_mm: float
    fading_mm_s: float = 20.0
    slip_s: float = 0.008
    scatter: float = 0.1


@dataclass(frozen=True, slots=True)
class World:
    """Everything that may be unlike the paper's law.

    Attributes
    ----------
    gains : tuple of callables
        Factors of the gain.
    cutoffs : tuple of callables
        From moment and cutoff, Hz, to cutoff; in turn.
    maps : tuple of callables
        From drive fraction, minutes and tone, Hz, to drive fraction.
    shelf, echo, section, stick_slip, relaxation : optional
    delay_s : float
    rolloff : Rolloff
    mount : Rational
    mains_n, mains_hz : float
    """

    gains: tuple[Callable[[Moment], FloatArray], ...] = ()
    cutoffs: tuple[Callable[[Moment, FloatArray], FloatArray], ...] = ()
    maps: tuple[Callable[[FloatArray, float, float], FloatArray], ...] = ()
    shelf: Shelf | None = None
    echo: Echo | None = None
    section: Section | None = None
    stick_slip: StickSlip | None = None
    relaxation: Relaxation | None = None
    delay_s: float = 0.0
    rolloff: Rolloff = FIRST_ORDER
    mount: Rational = THE_MOUNT
    mains_n: float = 0.0
    mains_hz: float = 50.0

    def with_gain(self, factor: Callable[[Moment], FloatArray]) -> "World":
        """Return a world with a further factor of the gain."""
        return replace(self, gains=(*self.gains, factor))

    def with_cutoff(self, change: Callable[[Moment, FloatArray], FloatArray]) -> "World":
        """Return a world with a further change of the cutoff."""
        return replace(self, cutoffs=(*self.cutoffs, change))

    def with_map(self, change: Callable[[FloatArray, float, float], FloatArray]) -> "World":
        """Return a world whose drive fraction is mapped further."""
        return replace(self, maps=(*self.maps, change))
