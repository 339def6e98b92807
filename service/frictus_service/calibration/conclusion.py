"""From the trials of a calibration to the model of a finger on a screen."""

import hashlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

import numpy as np
from scipy import stats

from frictus.model import FirstOrderSpeedLaw, Model, Validity
from frictus_hardware.arrays import FloatArray
from frictus_service.calibration.coordinates import Prior
from frictus_service.calibration.diagnostics import diagnose
from frictus_service.calibration.job import CalibrationResult, CalibrationSpec
from frictus_service.calibration.plan import RecordedTrial
from frictus_service.calibration.posterior import Posterior, estimate
from frictus_service.errors import EstimateError, Exclusion, NothingToIdentifyError
from frictus_service.identification.observation.response import TrialObservations


def prior_of(spec: CalibrationSpec) -> Prior:
    """Return what is known of a person before anything was measured."""
    return Prior.learn(spec.prior)


def estimate_of(spec: CalibrationSpec, observations: Sequence[TrialObservations]) -> Posterior:
    """Return the speed law that the observations say; the quick protocol's with the prior.

    Raises
    ------
    EstimateError
        If they do not determine it.
    """
    protocol = spec.protocol
    uses_prior = protocol.kind == "quick" and protocol.use_prior
    return estimate(observations, prior_of(spec) if uses_prior else None)


def precision_at(posterior: Posterior, speeds_mm_s: Sequence[float]) -> float:
    """Return half of the 95 % interval of the cutoff over its value, the worst speed's.

    Infinite where too few trials tell how they scatter.
    """
    return float(np.max(posterior.relative_width(np.array(speeds_mm_s))))


def precision_so_far(
    spec: CalibrationSpec, observations: Sequence[TrialObservations]
) -> float | None:
    """Return the precision that was reached; None where nothing can be said yet."""
    if not any(observed.valid for observed in observations):
        return None
    try:
        posterior = estimate_of(spec, observations)
    except EstimateError:
        return None
    precision = precision_at(posterior, spec.protocol.speeds_mm_s)
    return precision if np.isfinite(precision) else None


WIDER: Final = 1.1
"""An interval that grows by less is not spoken of."""


def why_wider(before: float | None, after: float | None) -> str:
    """Return why one more trial made an interval wider; empty where it did not.

    A trial only adds to what is known, but for one thing: how much the cutoff wanders is
    itself judged by the trials (`posterior.Mixture.wandering`).

    Parameters
    ----------
    before, after : float or None
        Half of the interval over its value; None: not known.
    """
    if before is None or after is None or after < WIDER * before:
        return ""
    return (
        f"the interval grew from {before:.1%} to {after:.1%}: the cutoff of this finger "
        "wanders more from trial to trial than those before had shown; more narrow it again"
    )


@dataclass(frozen=True, slots=True)
class CalibrationEstimate:
    """A model, and the intervals of its cutoff.

    Attributes
    ----------
    model : Model
        A `model/1` document.
    cutoff_hz : ndarray, shape (n_speeds,)
        At the speeds that were measured.
    half_width : ndarray, shape (n_speeds,)
        Of the 95 % interval, over the value.
    notes : tuple of str
        What a reader should know of the estimate.
    """

    model: Model
    cutoff_hz: FloatArray
    half_width: FloatArray
    notes: tuple[str, ...] = ()


def conclude(
    spec: CalibrationSpec,
    observations: Sequence[TrialObservations],
    done: Sequence[RecordedTrial],
    left_out: Sequence[str],
    study: Path,
    excluded: Sequence[Exclusion],
) -> CalibrationResult:
    """Return the result of a calibration whose trials are all done.

    Parameters
    ----------
    spec : CalibrationSpec
        What the calibration was asked for.
    observations : sequence of TrialObservations
        Of all trials.
    done : sequence of RecordedTrial
        In the order of recording.
    left_out : sequence of str
        What could not be measured.
    study : Path
        File of all trials.
    excluded : sequence of Exclusion
        Trials that it does not hold, since they cannot be read.

    Raises
    ------
    EstimateError
        If the valid trials do not say what the law is, or not how precisely.
    """
    valid = [observed.info for observed in observations if observed.valid]
    if not valid:
        last = f" (the last: {done[-1].rejected})" if done and done[-1].rejected else ""
        raise EstimateError(
            f"none of {len(done)} trials is valid{last}; {study} says why of each"
        )
    speeds = np.array(sorted({info.speed_mm_s for info in valid}))
    estimated = _by_analysis if spec.protocol.kind == "paper" else _by_prior
    found = estimated(spec, observations, speeds, study)
    precision = float(np.max(found.half_width))
    if not np.isfinite(precision):
        raise EstimateError(
            f"{len(valid)} valid trials do not tell how trials scatter; measure at least two "
            f"per speed. All of them are kept in {study}"
        )
    protocol, rejected = spec.protocol, [trial for trial in done if trial.rejected]
    reached = not left_out if protocol.kind == "paper" else precision <= protocol.precision
    return CalibrationResult(
        model=found.model,
        study=str(study),
        recorded_s=sum(trial.record_s for trial in done),
        precision=precision,
        reached=reached,
        notes=(
            *found.notes,
            *(f"not measured, rejected too often: {what}" for what in left_out),
            *(f"trial {trial.id} was rejected: {trial.rejected}" for trial in rejected),
            *(
                f"trial {lost.trial} is not in the study: {lost.field} {lost.reason}"
                for lost in excluded
            ),
        ),
        details={
            "trials": len(done),
            "trials_used": len(valid),
            "cutoff_hz": [
                {"speed_mm_s": speed, "value": value, "half_width": half}
                for speed, value, half in zip(
                    speeds.tolist(),
                    found.cutoff_hz.tolist(),
                    found.half_width.tolist(),
                    strict=True,
                )
            ],
            "diagnostics": asdict(
                diagnose(
                    observations,
                    found.model,
                    lambda some: estimated(spec, some, speeds, study).model,
                )
            ),
        },
    )


def _by_prior(
    spec: CalibrationSpec,
    observations: Sequence[TrialObservations],
    speeds_mm_s: FloatArray,
    study: Path,
) -> CalibrationEstimate:
    """Return what the trials and earlier people say together."""
    posterior = estimate_of(spec, observations)
    valid = [observed.info for observed in observations if observed.valid]
    forces, drives = (
        [getattr(info, name) for info in valid] for name in ("force_n", "drive_vpp")
    )
    validity = Validity(
        speed_mm_s=(float(speeds_mm_s[0]), float(speeds_mm_s[-1])),
        normal_force_n=(min(forces), max(forces)),
        drive_vpp=(min(drives), max(drives)),
    )
    model = posterior.model(spec.participant, validity, _provenance(spec, study))
    return CalibrationEstimate(
        model, posterior.cutoff_hz(speeds_mm_s), posterior.relative_width(speeds_mm_s)
    )


def _by_analysis(
    spec: CalibrationSpec,
    observations: Sequence[TrialObservations],
    speeds_mm_s: FloatArray,
    study: Path,
) -> CalibrationEstimate:
    """Return what the analysis of any study makes of the trials, one of one participant too."""
    from frictus_service.identification.analysis import identify
    from frictus_service.identification.models import participant_models

    try:
        identification = identify(observations, path=str(study), sha256=_sha256(study))
    except NothingToIdentifyError as error:
        raise EstimateError(str(error)) from error
    friction = [m for m in participant_models(identification) if m.response == "friction"]
    if not friction:
        # That intervals are of one person is so of every calibration, and no reason.
        why = [note for note in identification.notes if not note.startswith("One participant")]
        raise EstimateError(
            f"the trials give no speed law. {' '.join(why)} It takes three tones at each of "
            f"two speeds. All trials are kept in {study}"
        )
    found = friction[0]
    told = found.provenance | _provenance(spec, study)
    model = found.model_copy(update={"provenance": told})
    second = found.provenance.get("second_solution")
    return replace(_with_widths(model, speeds_mm_s), notes=(second,) if second else ())


def _with_widths(model: Model, speeds_mm_s: FloatArray) -> CalibrationEstimate:
    """Return the cutoff of a model with its interval, from its covariance."""
    law, covariance = model.base, model.covariance
    assert isinstance(law, FirstOrderSpeedLaw)
    assert covariance is not None
    cutoff = law.cutoff_0_hz + law.slope_hz_per_mm_s * speeds_mm_s
    names = ("cutoff_0_hz", "slope_hz_per_mm_s")
    at = [covariance.parameters.index(name) for name in names]
    spread = np.array(covariance.matrix)[np.ix_(at, at)]
    gradient = np.column_stack([np.ones_like(speeds_mm_s), speeds_mm_s])
    sd = np.sqrt(np.einsum("vi,ij,vj->v", gradient, spread, gradient))
    freedom = float(model.provenance["degrees_of_freedom"])
    return CalibrationEstimate(model, cutoff, stats.t.ppf(0.975, freedom) * sd / cutoff)


def _provenance(spec: CalibrationSpec, study: Path) -> dict[str, Any]:
    return {
        "source": f"calibration, {spec.protocol.kind} protocol",
        "rig": spec.rig,
        "participant": spec.participant,
        "study_sha256": _sha256(study),
        "code_version": version("frictus"),
        "settings": spec.protocol.model_dump(mode="json"),
        "seed": spec.seed,
        "earlier_models": len(spec.prior),
    }


def _sha256(file: Path) -> str:
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
