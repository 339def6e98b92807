"""Precision of a calibration against time: `python bench/quick_calibration.py --help`.

Beside the quick protocol, with and without its prior, stands the paper's: 375 trials of 10 s,
analysed in three ways. Observations are drawn for many people at once; with `--raw`, a few
people are simulated sample by sample and identified blind. Seeds are fresh and printed.
"""

import argparse
import json
import secrets
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, stats

from frictus.messages import Excitation
from frictus.model import Validity
from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.screen import Screen, screen_voltage
from frictus_hardware.physics.stages import (
    FORCE_NOISE_N,
    FrictionResponse,
    Quantisation,
    SensorNoise,
    standard_twin,
)
from frictus_hardware.physics.twin import Signals, simulate
from frictus_laboratory.reproduction.plan import StudyConditions, TrialPlan, plan_study
from frictus_laboratory.reproduction.population import (
    ALONG,
    POPULATION,
    SLOPE_SD,
    Person,
    Plane,
    draw_people,
)
from frictus_laboratory.reproduction.simulate import (
    ACCEL_NOISE_M_S2,
    BLOCK_SAMPLES,
    LEAD_S,
    POSITION_HZ,
    POSITION_STEP_MM,
    Rubbing,
    move,
    report,
    simulate_trial,
    study_info,
)
from frictus_service.calibration import coordinates, design
from frictus_service.calibration.coordinates import Prior
from frictus_service.calibration.plan import Ask
from frictus_service.calibration.posterior import Posterior, estimate
from frictus_service.calibration.precision import Variation, draw, paper_asks, quick_asks
from frictus_service.identification.analysis import identify
from frictus_service.identification.documents import Settings
from frictus_service.identification.observation.observe import observe
from frictus_service.identification.observation.response import TrialObservations
from frictus_service.study.trial import Trial

SPEEDS = np.array([20.0, 40.0, 60.0, 80.0, 100.0])
RECORD_S = 2.5
TRIALS = (2, 4, 6, 8, 12, 16, 20, 24, 30, 40, 60)
BUDGET = 30
"""Trials of the quick protocol in a fiftieth of the paper's recorded time."""
PAPER_S = 3750.0
EARLIER = 10
DELAY_S = 0.0
PICTURE = Path(__file__).parents[1] / "docs" / "quick_calibration.png"


def person_at(deviations: float, gain_n: float = 0.39) -> Person:
    """Return somebody so many standard deviations off the paper's population."""
    cutoff = POPULATION["cutoff_hz"]
    planes = {name: population.mean for name, population in POPULATION.items()}
    slope = cutoff.mean.per_mm_s * (1.0 + ALONG * SLOPE_SD * deviations)
    planes["cutoff_hz"] = Plane(cutoff.mean.middle + deviations * cutoff.between, slope)
    planes["gain_n"] = Plane(gain_n)
    return Person(f"P{round(100 * deviations):+d}", planes)


def truth_of(person: Person) -> FloatArray:
    """Return a person in `coordinates`."""
    cutoff = person.planes["cutoff_hz"]
    return coordinates.from_law(
        person.planes["gain_n"].middle, cutoff.at(0.0), cutoff.per_mm_s, DELAY_S
    )


def anybody(rng: np.random.Generator) -> FloatArray:
    """Return a person of the population."""
    return truth_of(draw_people(1, rng)[0])


def excitation_for(rng: np.random.Generator, prior: Prior) -> Excitation:
    """Return the quick protocol's multisine."""
    tones = design.lines(12)
    return design.multisine(rng, tones, design.powers(tones, prior, (20.0, 100.0)))


def prior_from(rng: np.random.Generator, variation: Variation) -> Prior:
    """Return what earlier people's quick calibrations teach."""
    excitation = excitation_for(rng, Prior.weak())
    models = []
    for number in range(EARLIER):
        asks = quick_asks(rng, excitation, BUDGET, RECORD_S)
        found = estimate(draw(rng, anybody(rng), asks, variation), Prior.weak())
        models.append(found.model(f"E{number}", Validity(), {}))
    return Prior.learn(models)


def worst(posterior: Posterior) -> float:
    """Return half of the 95 % interval over the cutoff, the worst speed's."""
    return float(np.max(posterior.relative_width(SPEEDS)))


def by_identification(observations: Sequence[TrialObservations]) -> float:
    """Return the same of the law that `frictus identify` gives."""
    settings = Settings(mixed_models=False, sweeps=False)
    friction = identify(observations, settings=settings).participants[0].friction
    if friction is None or friction.law is None or friction.degrees_of_freedom is None:
        raise SystemExit("the paper's protocol gave no speed law")
    law = friction.law
    matrix = np.array(law.covariance.matrix)[1:3, 1:3]
    row = np.column_stack([np.ones(SPEEDS.size), SPEEDS])
    error = np.sqrt(np.einsum("vi,ij,vj->v", row, matrix, row))
    value = law.cutoff_0_hz.value + law.slope_hz_per_mm_s.value * SPEEDS
    return float(np.max(stats.t.ppf(0.975, friction.degrees_of_freedom) * error / value))


def by_magnitude(observations: Sequence[TrialObservations]) -> float:
    """Return the same by the paper's way: magnitudes only, a line through the conditions."""
    points: dict[tuple[float, float], list[tuple[float, float]]] = {}
    for item in observations:
        size = float(np.median(np.abs(item.rows.friction_response)))
        condition = (item.info.speed_mm_s, item.info.force_n)
        points.setdefault(condition, []).append((item.info.tones_hz[0], size))
    speeds = np.array([speed for speed, _ in points])
    cutoffs = np.array([_magnitude_cutoff(np.array(own)) for own in points.values()])
    table = np.column_stack([np.ones(speeds.size), speeds])
    line = np.linalg.lstsq(table, cutoffs, rcond=None)[0]
    freedom = speeds.size - 2
    residual = float(np.sum((cutoffs - table @ line) ** 2)) / freedom
    row = np.column_stack([np.ones(SPEEDS.size), SPEEDS])
    spread = np.einsum("vi,ij,vj->v", row, np.linalg.inv(table.T @ table), row)
    half = stats.t.ppf(0.975, freedom) * np.sqrt(residual * spread)
    return float(np.max(half / np.maximum(row @ line, 1.0)))


def _magnitude_cutoff(points: FloatArray) -> float:
    tone, size = points.T

    def residual(log: FloatArray) -> FloatArray:
        law: FloatArray = np.exp(log[0]) / np.hypot(1.0, tone / np.exp(log[1])) - size
        return law

    found = optimize.least_squares(
        residual, [np.log(size.max()), np.log(1000.0)], bounds=([-9, 3], [3, 10])
    )
    return float(np.exp(found.x[1]))


def curve(
    rng: np.random.Generator, people: int, variation: Variation
) -> dict[str, list[float]]:
    """Return the median width over people after each number of quick trials."""
    prior = prior_from(rng, variation)
    excitation = excitation_for(rng, prior)
    with_prior: list[list[float]] = []
    without: list[list[float]] = []
    for _ in range(people):
        truth = anybody(rng)
        asks = quick_asks(rng, excitation, max(TRIALS), RECORD_S)
        drawn = draw(rng, truth, asks, variation)
        with_prior.append([worst(estimate(drawn[:n], prior)) for n in TRIALS])
        without.append([worst(estimate(drawn[:n], None)) for n in TRIALS])
    return {
        "with prior": np.median(with_prior, axis=0).tolist(),
        "without prior": np.median(without, axis=0).tolist(),
    }


def paper_widths(
    rng: np.random.Generator, people: int, variation: Variation
) -> dict[str, float]:
    """Return the median width of the paper's protocol, by analysis."""
    analyses: dict[str, Callable[[Sequence[TrialObservations]], float]] = {
        "magnitudes, as in the paper": by_magnitude,
        "frictus identify": by_identification,
        "the quick protocol's estimator": lambda drawn: worst(estimate(drawn, None)),
    }
    found: dict[str, list[float]] = {name: [] for name in analyses}
    for _ in range(people):
        drawn = draw(rng, anybody(rng), paper_asks(), variation)
        for name, analysis in analyses.items():
            found[name].append(analysis(drawn))
    return {name: float(np.median(values)) for name, values in found.items()}


def seconds_to(width: float, widths: Sequence[float]) -> float:
    """Return when the curve falls to a width, s; infinite where it does not."""
    below = np.flatnonzero(np.array(widths) <= width)
    if not below.size:
        return float("inf")
    at = int(below[0])
    if at == 0:
        return TRIALS[0] * RECORD_S
    x = np.log([TRIALS[at - 1], TRIALS[at]])
    y = np.log([widths[at - 1], widths[at]])
    return float(np.exp(np.interp(-np.log(width), -y, x)) * RECORD_S)


def coverage(
    rng: np.random.Generator, people: int, variation: Variation, n_trials: int
) -> dict[str, float]:
    """Return how often the intervals hold the truth, for people at -2 and +2 SD."""
    inside: dict[str, list[NDArray[np.bool_]]] = {"with prior": [], "without prior": []}
    prior = prior_from(rng, variation)
    for number in range(people):
        if number % 10 == 9:
            prior = prior_from(rng, variation)
        excitation = excitation_for(rng, prior)
        truth = truth_of(person_at(2.0 if number % 2 else -2.0))
        asks = quick_asks(rng, excitation, n_trials, RECORD_S)
        drawn = draw(rng, truth, asks, variation)
        for name, used in (("with prior", prior), ("without prior", None)):
            low, high = estimate(drawn, used).interval_hz(SPEEDS).T
            cutoff = coordinates.cutoff_hz(truth, SPEEDS)
            inside[name].append((low <= cutoff) & (cutoff <= high))
    return {name: float(np.mean(hits)) for name, hits in inside.items()}


def record(plan: TrialPlan, excitation: Excitation) -> Trial:
    """Return a trial of the reproduction's people and rig, driven by an excitation."""
    rng = np.random.default_rng(plan.seed)
    rate_hz = plan.info.sample_rate_hz
    lead = round(LEAD_S * rate_hz)
    sample = np.arange(-lead, round(plan.seconds * rate_hz))
    time_s = sample / rate_hz
    message = excitation.bias + sum(
        tone.amplitude * np.cos(2.0 * np.pi * tone.hz * time_s + tone.phase_rad)
        for tone in excitation.tones
    )
    fraction = np.clip(message, 0.0, 1.0)
    motion = move(plan, time_s, rng)
    signals = Signals.driven(
        rate_hz,
        screen_voltage(Screen(), fraction, -lead, rate_hz),
        motion.position_mm,
        motion.velocity_mm_s,
        motion.normal_force_n,
        motion.in_contact,
    )
    seeds = [int(seed) for seed in rng.integers(2**63, size=2)]
    sensors = (SensorNoise(FORCE_NOISE_N, ACCEL_NOISE_M_S2, seeds[0]), Quantisation())
    twin = standard_twin(
        law=plan.law,
        mobility=plan.mobility,
        friction_coefficient=plan.friction_coefficient,
        sensors=sensors,
    ).with_stage(Rubbing(plan.friction_coefficient, seeds[1]), after=FrictionResponse)
    felt = simulate(twin, signals, BLOCK_SAMPLES).rows(slice(lead, None))
    seen = report(motion, time_s, POSITION_HZ, POSITION_STEP_MM, rng)
    return Trial(
        info=plan.info,
        voltage_v=felt.voltage_v,
        force_n=felt.force_n,
        accel_m_s2=None,
        skin_velocity_m_s=None,
        position_mm=seen.position_mm,
        position_t_s=seen.time_s,
    )


def raw_quick(
    rng: np.random.Generator, person: Person, asks: Sequence[Ask]
) -> list[TrialObservations]:
    """Return what a person's quick trials say, from raw samples; bad ones are asked again."""
    shape = StudyConditions(
        tones_hz=(0.0,),
        speeds_mm_s=tuple(sorted({ask.speed_mm_s for ask in asks})),
        forces_n=tuple(sorted({ask.force_n for ask in asks})),
        seconds=asks[0].record_s,
    )
    plans = {
        (plan.info.speed_mm_s, plan.info.force_n): plan
        for plan in plan_study([person], shape, rng)
    }
    contact = shape.scatter.gain_per_trial
    out = []
    for order, ask in enumerate(asks):
        plan = plans[ask.speed_mm_s, ask.force_n]
        info = replace(plan.info, id=f"t{order}", order=order, tones_hz=ask.tones_hz)
        gain = person.planes["gain_n"].middle * np.exp(contact * rng.standard_normal())
        law = replace(plan.law, gain_n=float(gain))
        while True:
            seed = int(rng.integers(2**63))
            trial = record(replace(plan, info=info, law=law, seed=seed), ask.excitation)
            observed = observe(trial, study_info())
            if observed.valid:
                break
        out.append(observed)
    return out


def raw_paper(rng: np.random.Generator, person: Person) -> list[TrialObservations]:
    """Return what a person's 375 trials say, from raw samples."""
    plans = plan_study([person], StudyConditions(tuple(design.paper_tones().tolist())), rng)
    return [observe(simulate_trial(plan), study_info()) for plan in plans]


def raw(rng: np.random.Generator, people: int, paper_people: int) -> dict[str, object]:
    """Return widths and coverage from raw samples."""
    prior = prior_from(rng, Variation())
    excitation = excitation_for(rng, prior)
    counts = [n for n in TRIALS if n <= BUDGET]
    with_prior, without, inside = [], [], []
    for number in range(people):
        person = person_at(2.0 if number % 2 else -2.0)
        asks = quick_asks(rng, excitation, BUDGET, RECORD_S)
        seen = raw_quick(rng, person, asks)
        with_prior.append([worst(estimate(seen[:n], prior)) for n in counts])
        without.append([worst(estimate(seen[:n], None)) for n in counts])
        low, high = estimate(seen, prior).interval_hz(SPEEDS).T
        plane = person.planes["cutoff_hz"]
        cutoff = np.array([plane.at(speed) for speed in SPEEDS])
        inside.append((low <= cutoff) & (cutoff <= high))
    paper = [raw_paper(rng, person_at(0.0)) for _ in range(paper_people)]
    return {
        "trials": counts,
        "with prior": np.median(with_prior, axis=0).tolist(),
        "without prior": np.median(without, axis=0).tolist(),
        "coverage": float(np.mean(inside)),
        "people": people,
        "paper, frictus identify": [by_identification(seen) for seen in paper],
        "paper, same estimator": [worst(estimate(seen, None)) for seen in paper],
    }


def picture(
    found: dict[str, list[float]], paper: dict[str, float], raw_found: dict[str, object] | None
) -> None:
    """Draw the curves."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(8.0, 4.8), layout="constrained")
    time_s = np.array(TRIALS) * RECORD_S
    axes.loglog(time_s, 100 * np.array(found["with prior"]), "o-", label="quick")
    axes.loglog(
        time_s, 100 * np.array(found["without prior"]), "s--", label="quick, without prior"
    )
    if raw_found is not None:
        raw_s = np.array(raw_found["trials"]) * RECORD_S
        raw_width = 100 * np.array(raw_found["with prior"])
        axes.loglog(raw_s, raw_width, "kx", label="quick, from raw samples")
    for (name, width), colour in zip(paper.items(), ("C3", "C2", "C4"), strict=True):
        axes.axhline(100 * width, color=colour, lw=1, ls=":")
        axes.plot(PAPER_S, 100 * width, "D", color=colour, label=f"paper's, {name}")
    axes.axvline(PAPER_S / 50, color="0.6", lw=1)
    axes.text(PAPER_S / 50 * 1.05, 100 * max(paper.values()), "1/50", color="0.4", va="bottom")
    axes.set_xlabel("recorded with the finger on the screen, s")
    axes.set_ylabel("half of the 95 % interval / cutoff, %\n(worst of 20 to 100 mm/s)")
    axes.set_yticks([1, 2, 5, 10, 20], ["1", "2", "5", "10", "20"])
    axes.grid(alpha=0.3, which="both")
    axes.legend(fontsize=8)
    figure.savefig(PICTURE, dpi=120)


def main() -> None:
    """Measure, draw and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--people", type=int, default=20)
    parser.add_argument("--covered", type=int, default=400, help="people for the coverage")
    parser.add_argument("--raw", type=int, default=0, help="people sample by sample")
    parser.add_argument("--raw-paper", type=int, default=0)
    parser.add_argument("--seed", type=int, default=None)
    asked = parser.parse_args()
    seed = secrets.randbits(32) if asked.seed is None else asked.seed
    rng = np.random.default_rng(seed)
    results: dict[str, object] = {"seed": seed, "seconds": [n * RECORD_S for n in TRIALS]}
    raw_found = raw(rng, asked.raw, asked.raw_paper) if asked.raw else None
    results["raw"] = raw_found
    found, paper = curve(rng, asked.people, Variation()), paper_widths(rng, 5, Variation())
    results |= {"curve": found, "paper": paper}
    picture(found, paper, raw_found)
    for gain in (0.0, 0.05, 0.1, 0.2):
        for wandering in (0.05, 0.02, 0.0):
            variation = Variation(trial_gain=gain, condition_cutoff=wandering)
            own = curve(rng, max(asked.people // 4, 1), variation)["with prior"]
            beside = paper_widths(rng, 3, variation)
            results[f"gain {gain:g}, wandering {wandering:g}"] = {
                "quick at 1/50": own[TRIALS.index(BUDGET)],
                **beside,
                **{f"time for {k}": seconds_to(width, own) for k, width in beside.items()},
            }
    for n in (4, 12, BUDGET):
        results[f"coverage, {n * RECORD_S:g} s"] = coverage(rng, asked.covered, Variation(), n)
    print(json.dumps(results, indent=1))  # noqa: T201 - the result


if __name__ == "__main__":
    main()
