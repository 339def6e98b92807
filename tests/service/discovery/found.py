"""A discovery as it comes from a constant cutoff on fingers that follow the paper's law.

And one of several studies in which nothing is wrong.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from frictus.model import Effect, FirstOrderSpeedLaw, Model
from frictus_service.discovery.across_studies.document import (
    AcrossStudies,
    StudyLeftOut,
    StudyOutcome,
)
from frictus_service.discovery.catalogue.causes import CAUSES, separating_experiment
from frictus_service.discovery.document import (
    Alternative,
    CannotTell,
    CauseTest,
    Discovery,
    Evidence,
    Gain,
    LevelBin,
    NamedCause,
    ParameterEstimate,
    ParticipantValue,
    ResidualBin,
    StudyFacts,
    Unexplained,
    UnseenCondition,
)

TONES_HZ = (30.0, 90.0, 270.0, 800.0, 1900.0)
SPEEDS_MM_S = (20.0, 40.0, 60.0, 80.0, 100.0)
CUTOFF_0_HZ, SLOPE, CUTOFF_HZ = 385.68, 13.811, 1214.0


def response(tone_hz: float, cutoff_hz: float) -> complex:
    return 1.0 / (1.0 + 1j * tone_hz / cutoff_hz)


def residual(tone_hz: float, speed_mm_s: float, rng: np.random.Generator) -> ResidualBin:
    ratio = response(tone_hz, CUTOFF_0_HZ + SLOPE * speed_mm_s) / response(tone_hz, CUTOFF_HZ)
    noise_db, noise_deg = rng.normal(0.0, (0.1, 0.6))
    return ResidualBin(
        covariate="speed",
        level=speed_mm_s,
        tone_hz=tone_hz,
        before_db=20.0 * np.log10(abs(ratio)) + noise_db,
        before_deg=float(np.degrees(np.angle(ratio))) + noise_deg,
        after_db=noise_db,
        after_deg=noise_deg,
        error_db=0.1,
        error_deg=0.6,
    )


def cause(rng: np.random.Generator, **changes: Any) -> NamedCause:
    people = rng.normal(SLOPE, 2.0, 8)
    said = NamedCause(
        id="speed_dependent_cutoff",
        statement=CAUSES["speed_dependent_cutoff"].statement,
        verdict="confirmed",
        parameters={
            "slope_hz_per_mm_s": ParameterEstimate(
                value=float(people.mean()),
                ci95=(float(people.mean()) - 1.7, float(people.mean()) + 1.7),
                unit="Hz per mm/s",
                per_participant=tuple(
                    ParticipantValue(participant=f"P{i:02}", value=value, standard_error=0.5)
                    for i, value in enumerate(people, 1)
                ),
            )
        },
        p_value=0.0078,
        gain=gain(),
        alternatives=(
            Alternative(
                id="cutoff_drift",
                similarity=0.31,
                separating_experiment=separating_experiment(
                    "speed_dependent_cutoff", "cutoff_drift"
                ),
            ),
        ),
        next_experiment=CAUSES["speed_dependent_cutoff"].next_experiment,
    )
    return said.model_copy(update=changes)


def gain() -> Gain:
    return Gain(
        heldout_loglik=812.0,
        ci95=(640.0, 985.0),
        residual_db=(2.41, 0.71),
        residual_deg=(13.2, 3.1),
    )


def left() -> Unexplained:
    return Unexplained(
        channel="size", band_hz=(140.0, 220.0), covariate="position", p_value=0.02
    )


def pair() -> CannotTell:
    return CannotTell(
        between=("channel_delay", "fractional_rolloff"),
        separating_experiment=separating_experiment("channel_delay", "fractional_rolloff"),
        similarity=0.96,
        p_value=0.01,
    )


def tests() -> tuple[CauseTest, ...]:
    known = {
        "speed_dependent_cutoff": CauseTest(
            id="speed_dependent_cutoff",
            statistic=18.9,
            p_value=0.0078,
            detectable={"slope_hz_per_mm_s": 2.2},
        ),
        "gain_drift": CauseTest(id="gain_drift", not_tested="no trial says when it began"),
    }
    other = CauseTest(id="", statistic=1.2, p_value=0.9)
    return tuple(
        known.get(id_, other.model_copy(update={"id": id_}))
        for id_, one in CAUSES.items()
        if one.response != "mobility"
    )


def discovery(rng: np.random.Generator, **changes: Any) -> Discovery:
    """The constant cutoff fails, its dependence on speed is named, and nothing is left."""
    base = Model(
        base=FirstOrderSpeedLaw(gain_n=0.39, cutoff_0_hz=CUTOFF_HZ, slope_hz_per_mm_s=0.0)
    )
    named = cause(rng)
    slope = named.parameters["slope_hz_per_mm_s"].value
    effect = Effect(id=named.id, parameters={"slope_hz_per_mm_s": slope})
    said = Discovery(
        code_version="0.1.0",
        seed=int(rng.integers(2**31)),
        study=StudyFacts(
            path="a & b.h5", sha256="ab" * 32, participants=8, trials=480, trials_used=467
        ),
        response="friction",
        base_model=base,
        extended_model=base.model_copy(update={"effects": [effect]}),
        verdict="explained",
        causes=(named,),
        cannot_tell=(),
        unexplained=(),
        explained_share=0.97,
        gain=gain(),
        evidence=Evidence(
            participants=8,
            trials=467,
            rows=5604,
            held_out="participants",
            statement="8 participants, each predicted from the other seven.",
        ),
        tests=tests(),
        unseen=(
            UnseenCondition(
                covariate="speed", level=60.0, residual_db=(2.2, 0.7), residual_deg=(12.0, 3.0)
            ),
        ),
        residuals=tuple(
            residual(tone, speed, rng) for tone in TONES_HZ for speed in SPEEDS_MM_S
        ),
        levels=tuple(
            LevelBin(
                channel="second",
                covariate="speed",
                level=speed,
                measured=rng.normal(0.0, 1e-3),
                before=0.0,
                after=0.0,
                standard_error=1e-3,
                unit="of the fundamental",
            )
            for speed in SPEEDS_MM_S
        ),
    )
    return said.model_copy(update=changes)


def across(studies: Sequence[str], **changes: Any) -> AcrossStudies:
    """Return what is said of several clean studies, by name, and of one that is none."""
    said = AcrossStudies(
        code_version="0.1.0",
        response="friction",
        base_model=Model(
            base=FirstOrderSpeedLaw(
                gain_n=0.39, cutoff_0_hz=CUTOFF_0_HZ, slope_hz_per_mm_s=SLOPE
            )
        ),
        sentence="Nothing is wrong in any of them.",
        causes=(),
        base_parameters=(),
        studies=tuple(
            StudyOutcome(
                name=name,
                path=f"{name}.h5",
                sha256="0" * 64,
                participants=6,
                trials=24,
                trials_used=24,
                held_out="participants",
                verdict="clean",
                causes=(),
                report=f"studies/{name}/report.html",
            )
            for name in studies
        ),
        left_out=(StudyLeftOut(path="bad.h5", reason="it is no study"),),
    )
    return said.model_copy(update=changes)
