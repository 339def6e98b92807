"""Whether a law fits the trials that it was made from: points over it, residuals, held out.

As in tools of system identification: what was measured at each speed and tone with its
interval, what the fit leaves there, and how well trials are met that it did not see.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy import stats

from frictus.model import FirstOrderSpeedLaw, Model
from frictus_hardware.arrays import ComplexArray, FloatArray
from frictus_service.calibration import coordinates
from frictus_service.calibration.score_information import midway, usable
from frictus_service.errors import EstimateError
from frictus_service.identification.observation.response import TrialObservations
from frictus_service.synthesis.compensability import placeholder_model

FOLDS: Final = 6
FEWEST_TRIALS: Final = FOLDS
"""With fewer, what is left of them hardly determines a law."""
SHARE_GAIN: Final = 3
"""From so many tones on a trial tells the gain that they share."""
Estimate = Callable[[Sequence[TrialObservations]], Model]


@dataclass(frozen=True, slots=True)
class FittedPoint:
    """What was measured at one speed and tone, beside the fit.

    Attributes
    ----------
    speed_mm_s, tone_hz : float
        As they were asked for.
    trials : int
        That say something of it.
    magnitude_n, phase_deg : float
        Friction per full drive, the mean over trials, and how far it lags (negative).
    interval_n : tuple of float, or None
        95 %, from the scatter between trials, gains included; None: one trial has none.
    fit_n, fit_phase_deg : float
        Of the law.
    """

    speed_mm_s: float
    tone_hz: float
    trials: int
    magnitude_n: float
    phase_deg: float
    interval_n: tuple[float, float] | None
    fit_n: float
    fit_phase_deg: float

    @property
    def residual_db(self) -> float:
        """What the fit leaves, dB."""
        return float(20.0 * np.log10(self.magnitude_n / self.fit_n))


@dataclass(frozen=True, slots=True)
class HeldOutFit:
    """How well trials are met, one tone of one trial counting once; rms, dB.

    Attributes
    ----------
    folds : int
        Into so many parts the trials were dealt; each was predicted from the others.
    held_out_db : float
        Of trials that the estimate did not see.
    in_sample_db : float
        Of all trials, by the law made from them.
    placeholder_db : float
        Of all trials, by the model of a rig that nobody measured.
    """

    folds: int
    held_out_db: float
    in_sample_db: float
    placeholder_db: float


@dataclass(frozen=True, slots=True)
class FitDiagnostics:
    """What there is to see of a fit.

    Attributes
    ----------
    points : tuple of FittedPoint
        By speed, then tone.
    residual_db : float
        Root mean square of what the fit leaves at the points, dB.
    standardised : float or None
        The same in units of what the scatter between trials makes of it, without the gain that
        all tones of a trial share: about 1 where the law has the right shape; None where no
        point has three trials.
    held_out : HeldOutFit or None
        None where `note` says why not.
    note : str
        Why nothing was held out; empty if it was.
    """

    points: tuple[FittedPoint, ...]
    residual_db: float
    standardised: float | None
    held_out: HeldOutFit | None
    note: str = ""


def diagnose(
    observations: Sequence[TrialObservations], model: Model, estimate: Estimate
) -> FitDiagnostics:
    """Return how a law fits trials.

    Parameters
    ----------
    observations : sequence of TrialObservations
        Of one person; those that are not `usable` are left out.
    model : Model
        Made from them, of friction.
    estimate : callable
        From observations to a model, as `model` was made; may raise EstimateError.

    Raises
    ------
    EstimateError
        If no valid trial has a response.
    """
    observed = usable(observations)
    if not observed:
        raise EstimateError("no valid trial has a response")
    used = [midway(one) for one in observed]
    at = _coordinates_of(model)
    ratios = [_ratios(one, at) for one in used]
    points, standardised = _points(used, ratios, at)
    residuals = np.array([point.residual_db for point in points])
    note, held_out = "", None
    if len(used) < FEWEST_TRIALS:
        note = f"nothing was held out: that takes {FEWEST_TRIALS} valid trials, not {len(used)}"
    else:
        try:
            held_out = _held_out(observed, used, at, estimate)
        except EstimateError as error:
            note = f"nothing was held out: of a part of the trials no law can be made ({error})"
    return FitDiagnostics(
        points,
        float(np.sqrt(np.mean(residuals**2))),
        float(np.sqrt(np.mean(standardised**2))) if standardised.size else None,
        held_out,
        note,
    )


def _coordinates_of(model: Model) -> FloatArray:
    law = model.base
    assert isinstance(law, FirstOrderSpeedLaw)
    values = law.gain_n, law.cutoff_0_hz, law.slope_hz_per_mm_s, model.skew_s
    return coordinates.from_law(*values)


def _ratios(one: TrialObservations, at: FloatArray) -> dict[float, complex]:
    """Return measured over predicted by the tone that was asked for, weighted over the rows."""
    rows = one.rows
    predicted = coordinates.response(at, rows.speed_mm_s, rows.tone_hz)
    asked = np.array(one.info.tones_hz)
    nearest = np.argmin(np.abs(rows.tone_hz[:, np.newaxis] - asked), axis=1)
    weight = np.abs(predicted) ** 2 / rows.friction_variance
    ratio: ComplexArray = rows.friction_response / predicted
    return {
        float(asked[tone]): complex(
            np.average(ratio[nearest == tone], weights=weight[nearest == tone])
        )
        for tone in np.unique(nearest)
    }


def _points(
    used: Sequence[TrialObservations], ratios: Sequence[dict[float, complex]], at: FloatArray
) -> tuple[tuple[FittedPoint, ...], FloatArray]:
    """Return the points, and the standardised residuals of those with three trials or more."""
    of_point: dict[tuple[float, float], list[tuple[complex, float]]] = {}
    for one, by_tone in zip(used, ratios, strict=True):
        logs_of_trial = np.log(np.array(list(by_tone.values())))
        gain = float(np.mean(logs_of_trial.real)) if len(by_tone) >= SHARE_GAIN else 0.0
        for tone_hz, log in zip(by_tone, logs_of_trial.tolist(), strict=True):
            of_point.setdefault((one.info.speed_mm_s, tone_hz), []).append((log, gain))
    points, standardised = [], []
    for (speed_mm_s, tone_hz), measured in sorted(of_point.items()):
        logs, gains = (np.array(each) for each in zip(*measured, strict=True))
        n, mean = logs.size, complex(np.mean(logs))
        fit = complex(coordinates.response(at, np.array(speed_mm_s), np.array(tone_hz)))
        interval = None
        if n > 1:
            se = float(np.std(logs.real, ddof=1)) / np.sqrt(n)
            half = float(stats.t.ppf(0.975, n - 1)) * se
            ends = abs(fit) * np.exp(mean.real + np.array([-half, half]))
            interval = float(ends[0]), float(ends[1])
            if n > 2 and np.ptp(logs.real - gains) > 0.0:
                standardised.append(_standardised(logs.real - gains))
        points.append(
            FittedPoint(
                speed_mm_s,
                tone_hz,
                n,
                abs(fit) * float(np.exp(mean.real)),
                float(np.degrees(np.angle(fit) + mean.imag)),
                interval,
                abs(fit),
                float(np.degrees(np.angle(fit))),
            )
        )
    return tuple(points), np.array(standardised)


def _standardised(logs: FloatArray) -> float:
    """Return a mean over its standard error, as a normal variate.

    Of few trials it is not well known how they scatter, so t is not yet normal.
    """
    likely = stats.ttest_1samp(logs, 0.0)
    return float(np.sign(np.mean(logs)) * stats.norm.isf(0.5 * max(likely.pvalue, 1e-12)))


def _held_out(
    observed: Sequence[TrialObservations],
    used: Sequence[TrialObservations],
    at: FloatArray,
    estimate: Estimate,
) -> HeldOutFit:
    errors = []
    for fold in range(FOLDS):
        rest = [one for number, one in enumerate(observed) if number % FOLDS != fold]
        errors.append(_errors_db(used[fold::FOLDS], _coordinates_of(estimate(rest))))
    return HeldOutFit(
        FOLDS,
        _rms(np.concatenate(errors)),
        _rms(_errors_db(used, at)),
        _rms(_errors_db(used, _coordinates_of(placeholder_model()))),
    )


def _errors_db(used: Sequence[TrialObservations], at: FloatArray) -> FloatArray:
    """Return measured over predicted of each tone of each trial, dB."""
    every = [abs(ratio) for one in used for ratio in _ratios(one, at).values()]
    errors: FloatArray = 20.0 * np.log10(np.array(every))
    return errors


def _rms(errors_db: FloatArray) -> float:
    return float(np.sqrt(np.mean(errors_db**2)))
