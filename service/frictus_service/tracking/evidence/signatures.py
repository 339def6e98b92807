"""How each cause of the catalogue, and any other pattern, changes the response in windows.

The direction d ln H / d dose of a cause in every window and band is the numeric derivative of
the effect's own equations (`frictus_hardware.physics.effects`) at the estimated law: nothing is
written a second time. What no cause is made of is looked for in patterns: octaves of modulus or
phase that follow one covariate or none, and thirds of them.
"""

from dataclasses import dataclass, replace
from itertools import pairwise, product
from typing import Final

import numpy as np

from frictus_hardware.arrays import ComplexArray, FloatArray
from frictus_hardware.physics.effects import EFFECTS
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.linear import TransferFunction
from frictus_hardware.physics.schedule import (
    REFERENCE_SPEED_MM_S,
    LawSchedule,
    SlidingConditions,
)
from frictus_hardware.physics.simulator import Probe, Simulator, predict
from frictus_service.calibration import coordinates
from frictus_service.discovery.problem.candidates import Candidate, candidates_of, scaled
from frictus_service.tracking.estimation.batch import Batch


@dataclass(frozen=True, slots=True)
class Size:
    """Of a cause's dose, in its unit.

    Attributes
    ----------
    tolerated : float
        A smaller one raises no alarm.
    expected : float
        Standard deviation of what is tried beyond it.
    """

    tolerated: float
    expected: float


SIZES: Final = {
    "amplitude_compression": Size(0.02, 0.05),
    "charge_leakage": Size(0.2, 2.0),
    "cutoff_drift": Size(0.01, 0.04),
    "direction_asymmetry": Size(0.02, 0.08),
    "force_dependent_cutoff": Size(0.06, 0.3),
    "force_dependent_gain": Size(0.06, 0.3),
    "fractional_rolloff": Size(0.02, 0.15),
    "gain_drift": Size(0.01, 0.04),
    "mount_resonance_shift": Size(0.002, 0.01),
    "position_dependent_gain": Size(0.001, 0.005),
    "residual_quadratic": Size(0.02, 0.05),
    "speed_dependent_gain": Size(0.06, 0.3),
}
"""Of effects whose direction the law's own parameters do not have. Tolerated: below half of the
size that a study finds in most runs, or what a texture rendered without it does not show."""
EFFECT_CAUSES: Final = tuple(sorted(SIZES))
LAW_CAUSES: Final = ("gain", "cutoff", "speed_dependent_cutoff", "delay")
LAW_SIZES: Final = (Size(0.15, 0.3), Size(0.10, 0.5), Size(1.5, 5.0), Size(15e-6, 100e-6))
"""Of `LAW_CAUSES`: ln gain, ln cutoff, Hz per mm/s, s."""
INSTRUMENT: Final[frozenset[str]] = frozenset(
    {"delay"} | {name for name, effect in EFFECTS.items() if effect.scope == "instrument"}
)
"""Causes that are the rig's and never the finger's."""

OCTAVES_HZ: Final = (0.0, 80.0, 160.0, 320.0, 640.0, 1280.0, np.inf)
THIRDS_HZ: Final = (0.0, *(43.0 * 2.0 ** (k / 3.0) for k in range(1, 17)), np.inf)
"""Limits; a resonance is narrower than what follows a covariate."""
COVARIATES: Final = ("none", "speed", "force", "position", "direction")


@dataclass(frozen=True, slots=True)
class EvidencePattern:
    """A misfit of modulus or phase in some bands, that follows one covariate or none.

    Attributes
    ----------
    low_hz, high_hz : float
        An octave, or a third of one.
    part : str
        "modulus" or "phase".
    covariate : str
        One of `COVARIATES`; it runs from about -1 to 1.
    """

    low_hz: float
    high_hz: float
    part: str
    covariate: str


PATTERNS: Final = tuple(
    EvidencePattern(low, high, part, covariate)
    for covariate, part in product(COVARIATES, ("modulus", "phase"))
    for limits in ((OCTAVES_HZ, THIRDS_HZ) if covariate == "none" else (OCTAVES_HZ,))
    for low, high in pairwise(limits)
)
PATTERN_SIZE: Final = Size(0.05, 0.15)
"""Relative, or radians: 0.4 dB or 3 degrees are tolerated."""

_LOW_HZ: Final = np.array([each.low_hz for each in PATTERNS])
_HIGH_HZ: Final = np.array([each.high_hz for each in PATTERNS])
_COVARIATE: Final = np.array([COVARIATES.index(each.covariate) for each in PATTERNS])
_PART: Final = np.array([1.0 if each.part == "modulus" else 1j for each in PATTERNS])
_CANDIDATES: Final[dict[str, Candidate]] = {
    each.effect: each for each in candidates_of("friction") if each.effect in SIZES
}

SHAPED: Final = np.array(
    [
        _CANDIDATES[name].extend(Simulator(), SIZES[name].tolerated).schedule == LawSchedule()
        for name in EFFECT_CAUSES
    ]
)
"""Of `EFFECT_CAUSES`: those that change how the response goes over frequency, and not only how
gain and cutoff follow the conditions. A lasting error of some bands may look like them."""
SHAPED_BY_A_FINGER: Final = frozenset(
    name for name, shaped in zip(EFFECT_CAUSES, SHAPED, strict=True) if shaped
).difference(INSTRUMENT)
"""Of a finger, and shaped as else only what is the rig's: with some textures a mount that has
shifted looks like a finger whose roll-off has another order."""
NOT_FITTED: Final = INSTRUMENT | SHAPED_BY_A_FINGER
"""Causes with which no gain and cutoff are put in force: they are not the finger's, or may not
be, or are a finger's to whose response no gain and cutoff fit."""


def law_directions(at: FloatArray) -> FloatArray:
    """Return d coordinates / d dose of each of `LAW_CAUSES`, per its expected size.

    Parameters
    ----------
    at : ndarray, shape (4,)
        The model in force, in `calibration.coordinates`.
    """
    middle = REFERENCE_SPEED_MM_S
    slope = (np.array([coordinates.LOW_MM_S, coordinates.HIGH_MM_S]) - middle) / np.exp(at[:2])
    along = np.array(
        [[0.0, 0.0, 1.0, 0.0], [1.0, 1.0, 0.0, 0.0], [*slope, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
    )
    directions: FloatArray = along * np.array([[size.expected] for size in LAW_SIZES])
    return directions


def effect_directions(
    batch: Batch, at: FloatArray, mount: TransferFunction | None, since_minutes: float
) -> ComplexArray:
    """Return d ln H / d dose of every effect.

    Parameters
    ----------
    batch : Batch
        Of windows.
    at : ndarray, shape (4,)
        The law, in `calibration.coordinates`.
    mount : TransferFunction or None
        Nominal, between screen and force sensor.
    since_minutes : float
        Of the device, at which drifts began.

    Returns
    -------
    ndarray of complex, shape (n_windows, n_bands, n_effects)
        In the order of `EFFECT_CAUSES`, per `Size.expected`.
    """
    gain, cutoff_0, slope, delay = coordinates.to_law(at)
    ends = (coordinates.LOW_MM_S, coordinates.HIGH_MM_S)
    law = FrictionLaw(gain, cutoff_0, slope, ends)
    base = Simulator(law=law, mount=mount, delay_s=max(delay, 0.0))
    probe = _probe(batch, since_minutes)
    seen = predict(base, probe, mount).friction
    shape = batch.cross.shape
    found = np.empty((*shape, len(EFFECT_CAUSES)), dtype=np.complex128)
    for number, name in enumerate(EFFECT_CAUSES):
        candidate = _CANDIDATES[name]
        changed = predict(candidate.extend(base, candidate.step), probe, mount).friction
        along = (changed / seen - 1.0) * (SIZES[name].expected / candidate.step)
        found[..., number] = along.reshape(shape)
    return found


def _probe(batch: Batch, since_minutes: float) -> Probe:
    n_bands = batch.bands.centre_hz.size
    around = batch.conditions
    around = replace(around, minutes=around.minutes - since_minutes)
    repeated = SlidingConditions(
        *(
            np.repeat(getattr(around, name), n_bands)
            for name in ("speed_mm_s", "normal_force_n", "position_mm", "direction", "minutes")
        )
    )
    share = batch.drive_power / batch.drive_power.sum(axis=1, keepdims=True) / batch.bands.lines
    amplitude = np.sqrt(2.0 * batch.drive_variance[:, np.newaxis] * share)
    return Probe(
        batch.frequency_hz.real.ravel(),
        amplitude.ravel().astype(np.complex128),
        np.repeat(batch.drive_mean, n_bands),
        np.repeat(batch.drive_variance, n_bands),
        repeated,
    )


def pattern_directions(batch: Batch) -> ComplexArray:
    """Return d ln H of every pattern, shape (n_windows, n_bands, n_patterns).

    Parameters
    ----------
    batch : Batch
        Of windows.
    """
    around = batch.conditions
    values = np.stack(
        [
            np.ones(batch.speed_mm_s.size) if name == "none" else scaled(name, around)
            for name in COVARIATES
        ],
        axis=1,
    )
    centre = batch.bands.centre_hz[:, np.newaxis]
    inside = (centre >= _LOW_HZ) & (centre < _HIGH_HZ)
    along = PATTERN_SIZE.expected * values[:, np.newaxis, _COVARIATE] * inside
    directions: ComplexArray = along * _PART
    return directions
