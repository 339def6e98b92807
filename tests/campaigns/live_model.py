"""Many sessions of a model that follows its finger: `python -m tests.campaigns.live_model -h`.

One line of JSON a session, with its seed. What is asked of them is in `bench/tracking.py`,
which writes the document from the lines.
"""

import ast
import hashlib
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any, Final

import numpy as np
from tests.blind.cases import REALISTIC, cause
from tests.campaigns.lines import Line, asked, go_on

from frictus.aligned import AlignedSamples
from frictus.recordings import texture_of
from frictus.textures import Component, Spectrum, Texture
from frictus_hardware.arrays import FloatArray
from frictus_hardware.simulated.config import draw_participant
from frictus_laboratory.live_model.closed_loop import PIECE_SAMPLES, ClosedLoop, Moment
from frictus_laboratory.live_model.discovered import discovered
from frictus_laboratory.live_model.disturbances import (
    FAULTS,
    Disturbance,
    Faulty,
    Later,
    NewFinger,
    Section,
    SpeedTimesForce,
    WithEffect,
    WithinPerson,
    drift,
    gain_step,
    scaled,
)
from frictus_laboratory.live_model.laws import model_of, values_of
from frictus_laboratory.live_model.motion import Motion, rendered_rows
from frictus_laboratory.live_model.session_plan import SessionPlan, motion_of
from frictus_service import tracking
from frictus_service.calibration import coordinates
from frictus_service.library import SHIPPED
from frictus_service.synthesis.compensability import placeholder_model
from frictus_service.tracking.windows import SPEEDS_MM_S

TEXTURES: Final = ("flat", "paper", "sandpaper", "fabric1", "fabric2", "vinyl")
LEARNED: Final = (*TEXTURES, "grating")
"""Of which a finger is learned from nothing: a grating plays one line."""
GRATING_MM: Final = 0.5
"""Period: 40 to 200 Hz at 20 to 100 mm/s."""
FACTORS: Final = ("0.5", "1", "2")
"""Of a person's cutoff."""
STEADY: Final = tuple(product(("paper", "vinyl", "grating"), ("25", "40", "60", "90")))
"""What is played, and speeds in mm/s to which a finger keeps."""
RATE_HZ: Final = 20_000.0
WITHIN_DB: Final = 0.1
NULL_S: Final = 1_200.0
NULLS: Final = ("exact", "scatter", "scatter_observe")
"""A finger that is constant, or scatters within its person, followed or just observed."""
LIFTS: Final = 0.2
"""How often the finger leaves the screen between two strokes, where contacts differ."""
_OF_CONTACT: Final = np.array([False, False, True, False])
"""What of the law a contact draws anew; cutoffs are the person's, about which strokes lie."""
STEP_S: Final = 30.0
"""When a finger changes."""
DRIFT_PER_MINUTE: Final = 0.02
SIZES: Final = ("1", "4")
"""Of a cause, times the size that the blind studies hide."""
UNKNOWN: Final = ("hidden_mode", "fast_notch", "speed_times_force", "gain_step")
RIG: Final = {
    "delay": WithEffect("channel_delay", {"delay_s": 100e-6}),
    "mount": WithEffect("mount_resonance_shift", {"share": -0.05}),
    "mains": WithEffect("mains_interference", {"amplitude_n": 0.02, "frequency_hz": 50.0}),
}
EDGES: Final = ("audit", "carried", "live", "model_history", "process", "recorded")
"""Modules that bring the tracker samples from elsewhere: no session here runs them."""
TURN_S: Final = 20.0
"""So long two people take turns."""
STARTS: Final = ("right", "placeholder")
"""The model in force at the beginning: the person's own, or that of nobody."""
RIG_STARTS: Final = (*STARTS, "later")
"""And the person's own where the rig becomes wrong after `STEP_S`."""


def names(times: int) -> list[str]:
    """Return the names of all sessions, kinds mixed, so that a part of them says something.

    Parameters
    ----------
    times : int
        Sessions of each name; of changes more.
    """
    kinds: list[tuple[str, Sequence[str]]] = [
        ("learn", [f"{texture}/{factor}" for texture in LEARNED for factor in FACTORS]),
        ("moisture", [""] * 3),
        ("new_finger", [""] * 5),
        ("turns", STARTS),
        ("rig", [f"{id_}/{start}" for id_ in RIG for start in RIG_STARTS]),
        ("fault", [f"{id_}/{start}" for id_ in FAULTS for start in STARTS]),
        ("drift", [""]),
        ("null", NULLS),
        ("cause", [f"{id_}/{size}" for id_ in REALISTIC for size in SIZES]),
        ("unknown", UNKNOWN),
        ("known", [f"{texture}/{factor}" for texture in LEARNED for factor in FACTORS]),
        ("steady", [f"{texture}/{speed}" for texture, speed in STEADY]),
        ("scatter", [f"{texture}/{factor}" for texture in LEARNED for factor in FACTORS]),
    ]
    found = []
    for kind, which in kinds:
        for place, name in enumerate(which):
            before = which[:place].count(name)
            repeated = which.count(name)
            for number in range(times):
                found.append((number, f"{kind}/{name or 'both'}/{repeated * number + before}"))
    return [name for _, name in sorted(found, key=lambda each: each[0])]


def plan_of(name: str, seed: int) -> SessionPlan:
    """Return the plan of a session.

    Parameters
    ----------
    name : str
        One of `names`.
    seed : int
        Of person, strokes and noise.
    """
    kind, *which, _ = name.split("/")
    rng = np.random.default_rng(seed)
    person = draw_participant(rng)
    plan = SessionPlan(
        person, texture("paper"), 60.0, int(rng.integers(2**31)), model_of(person), "adapt"
    )
    if kind in ("learn", "known", "scatter"):
        plan = replace(
            plan,
            person=scaled(person, 1.0, float(which[1])),
            texture=texture(which[0]),
            seconds=30.0,
            first=placeholder_model(),
            known_motion=kind == "known",
        )
        return replace(plan, **_within_person(seed)) if kind == "scatter" else plan
    if kind == "steady":
        return replace(plan, texture=texture(which[0]), steady_mm_s=float(which[1]))
    any_texture = texture(TEXTURES[int(rng.integers(len(TEXTURES)))])
    plan = replace(plan, texture=any_texture, known_motion=True)
    if kind == "null":
        plan = replace(plan, seconds=NULL_S)
        if which[0] == "exact":
            return plan
        return replace(
            plan,
            policy="observe" if which[0] == "scatter_observe" else "adapt",
            **_within_person(seed),
        )
    if kind == "turns":
        return replace(
            plan,
            seconds=6.0 * TURN_S,
            first=plan.first if which[0] == "right" else placeholder_model(),
            disturbance=NewFinger(draw_participant(rng), TURN_S, TURN_S),
            lift_probability=LIFTS,
        )
    if kind in ("rig", "fault"):
        id_, start = which
        if start == "placeholder":
            plan = replace(plan, first=placeholder_model())
        if kind == "fault":
            return replace(plan, disturbance=Faulty(id_, 20.0 * (start == "right")))
        wrong = RIG[id_]
        return replace(plan, disturbance=Later(wrong, STEP_S) if start == "later" else wrong)
    if kind == "cause":
        hidden = cause(which[0], float(which[1]), rng)
        effect = WithEffect(hidden.name, hidden.parameters)
        return replace(plan, policy="observe", disturbance=effect)
    if kind == "unknown":
        return replace(plan, policy="observe", disturbance=_unknown(which[0], rng))
    if kind == "drift":
        per_minute = DRIFT_PER_MINUTE * float(rng.choice([-1.0, 1.0]))
        return replace(plan, seconds=300.0, disturbance=drift(per_minute))
    if kind == "moisture":
        return replace(plan, disturbance=gain_step(0.8, STEP_S, 1.0))
    return replace(plan, disturbance=NewFinger(draw_participant(rng), STEP_S))


def _within_person(seed: int) -> dict[str, Any]:
    """Return what of a plan makes contacts and strokes of a person differ."""
    return {"disturbance": WithinPerson(seed), "lift_probability": LIFTS}


def _unknown(which: str, rng: np.random.Generator) -> Disturbance:
    """Return what the blind studies hide without a name, at the same sizes."""
    sign = float(rng.choice([-1.0, 1.0]))
    if which == "hidden_mode":
        return Section(10.0 ** (sign * 2.0 / 20.0) - 1.0, 180.0, 8.0)
    if which == "fast_notch":
        return Section(-0.3, 500.0, 2.0, fast_only=True)
    if which == "speed_times_force":
        return SpeedTimesForce(0.4 * sign)
    return gain_step(float(np.exp(0.3 * sign)), STEP_S, 0.0)


@cache
def texture(name: str) -> Texture:
    """Return a shipped texture, or the grating.

    Parameters
    ----------
    name : str
        Of its file, or ``grating``.
    """
    if name == "grating":
        line = Component(amplitude_n=0.05, cycles_per_mm=1.0 / GRATING_MM)
        return Spectrum(components=[line])
    return texture_of((SHIPPED / f"{name}.json").read_text(encoding="utf-8"))


def run(name: str, seed: int, seconds: float | None = None) -> Line:
    """Run a session and return its line.

    Parameters
    ----------
    name : str
        One of `names`.
    seed : int
        Of everything random.
    seconds : float, optional
        Instead of its own length.
    """
    plan = plan_of(name, seed)
    plan = plan if seconds is None else replace(plan, seconds=seconds)
    motion = motion_of(plan)
    line = _summary(name, plan, motion)
    if name.startswith(("learn/", "known/", "scatter/", "steady/")):
        line["observe"] = _summary(name, replace(plan, policy="observe"), motion)
        line["speed_error_mm_s"] = _speed_error(motion, plan.seconds)
    return line | {"code": code(), "failures": []}


@cache
def code() -> str:
    """Return a mark of the code that tracks, the same whatever its comments and docstrings."""
    mark = hashlib.sha256()
    for path in sorted(Path(tracking.__file__).parent.rglob("*.py")):
        if path.stem in EDGES:
            continue
        tree = ast.parse(path.read_text(encoding="utf-8"))
        for node in ast.walk(tree):
            body = getattr(node, "body", None)
            if isinstance(body, list):
                node.body = [each for each in body if not _says_only(each)]  # type: ignore[attr-defined]
        mark.update(ast.dump(tree).encode())
    return mark.hexdigest()[:8]


def _says_only(node: ast.AST) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def _summary(name: str, plan: SessionPlan, motion: Motion) -> Line:
    kept: list[AlignedSamples] = []
    hidden = name.startswith(("cause/", "unknown/"))
    loop = ClosedLoop(plan, motion, kept.append if hidden else lambda part: None)
    moments, true = [], [loop.true]
    for moment in loop:
        moments.append(moment)
        true.append(loop.true)
    estimate = loop.tracker.estimate
    felt = true[1 + round(60.0 * estimate.last_minutes * RATE_HZ) // PIECE_SAMPLES]
    person = coordinates.from_law(*values_of(plan.person.law), 0.0)
    scatters = isinstance(plan.disturbance, WithinPerson)
    contact = np.where(_OF_CONTACT, felt, person) if scatters else felt
    ranked = discovered(kept, plan.first, loop.screen.peak_v) if hidden else None
    first = ranked.models[0].causes if ranked and ranked.beyond_threshold else ()
    return {
        "discovered": list(first),
        "seconds": plan.seconds,
        "begins_db": _brief(moments[0].first_db),
        "newest_db": _brief(moments[-1].newest_db),
        "in_force_db": _brief(moments[-1].in_force_db),
        "first_db": _brief(moments[-1].first_db),
        "z": _standardised(estimate.mean, estimate.covariance, contact)
        if estimate.updates
        else [],
        "z_person": _standardised(*estimate.person, person) if scatters else [],
        "newest_within_s": _within(moments, 0.0, WITHIN_DB, lambda each: each.newest_db),
        "in_force_within_s": _within(moments, 0.0, WITHIN_DB, lambda each: each.in_force_db),
        "excess_db": _excess(moments),
        "named": loop.named,
        "changes": loop.changes,
        "new_fingers": loop.new_fingers,
        "held": dict(loop.held.most_common(6)),
        "refused": dict(loop.tracker.state(0).refused),
        "windows": estimate.windows,
        "arithmetic_s": round(loop.arithmetic_s, 4),
        "followed": _followed(name, moments),
    }


def _speed_error(motion: Motion, seconds: float) -> list[float]:
    """Return mean and SD of predicted less true speed, over pieces of steady sliding, mm/s."""
    error = []
    for piece_at in range(0, round(seconds * RATE_HZ), PIECE_SAMPLES):
        piece = motion.piece(piece_at, PIECE_SAMPLES)
        predicted = rendered_rows(piece.courses, RATE_HZ)[2]
        if predicted.min() > SPEEDS_MM_S[0] and predicted.max() < 1.5 * predicted.min():
            true = np.hypot(*piece.velocity_mm_s.T)
            error.append(float(predicted.mean() - true.mean()))
    return [_brief(float(np.mean(error))), _brief(float(np.std(error)))]


def _standardised(mean: FloatArray, covariance: FloatArray, true: FloatArray) -> list[float]:
    """Return how far each coordinate is off, in standard deviations."""
    return [_brief(float(each)) for each in (mean - true) / np.sqrt(np.diag(covariance))]


def _brief(value: float) -> float:
    return round(value, 4)


def _within(
    moments: Sequence[Moment], after_s: float, limit_db: float, of: Callable[[Moment], float]
) -> float | None:
    """Return from when on an error stays below a limit, s; None if it does not."""
    above = [each.at_s for each in moments if of(each) > limit_db]
    last = max([after_s, *above])
    return None if last >= moments[-1].at_s else round(last - after_s, 2)


def _excess(moments: Sequence[Moment]) -> dict[str, float]:
    """Return by how much the model in force was worse than the first, over time."""
    excess = np.array([each.in_force_db - each.first_db for each in moments])
    return {
        "median": _brief(float(np.median(excess))),
        "q95": _brief(float(np.quantile(excess, 0.95))),
        "worst": _brief(float(excess.max())),
        "mean": _brief(float(excess.mean())),
        "above_0.02": _brief(float(np.mean(excess > 0.02))),
    }


def _followed(name: str, moments: Sequence[Moment]) -> dict[str, Any]:
    kind = name.split("/")[0]
    if kind == "drift":
        late = [each for each in moments if each.at_s > 60.0] or moments
        return {
            of: [
                _brief(float(np.quantile([getattr(m, of) for m in late], q))) for q in (0.5, 1)
            ]
            for of in ("newest_db", "in_force_db", "first_db")
        }
    if kind not in ("moisture", "new_finger"):
        return {}
    limit = max(0.1 * moments[-1].first_db, 0.05)
    return {
        "step_db": _brief(moments[-1].first_db),
        "newest_s": _within(moments, STEP_S, limit, lambda each: each.newest_db),
        "in_force_s": _within(moments, STEP_S, limit, lambda each: each.in_force_db),
    }


def main() -> None:
    """Run the campaign, or a part of it."""
    path, wanted, seed = asked(__doc__, "times", 6, "sessions of each name", names)
    for line in go_on(path, wanted, seed, run):
        told = {key: line[key] for key in ("newest_db", "in_force_db", "named", "arithmetic_s")}
        sys.stdout.write(f"{line['name']} {line['seed']} {told}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
