"""The generator against analytic responses, through the estimator that judges real trials."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.blind.cases import OTHER_FORMS, REALISTIC, cause
from tests.blind.generator import Design, Hidden
from tests.blind.generator.hide import hide
from tests.blind.generator.motion import Motion, move_lifelike
from tests.blind.generator.people import CUTOFF_HZ, GAIN_N, SLOPE_HZ_PER_MM_S
from tests.blind.generator.recursion import RATE_HZ
from tests.blind.generator.transfer import mount, other_mount
from tests.blind.generator.trial import LEAD_SAMPLES, reports
from tests.blind.generator.world import Moment, World
from tests.blind.observed import ONE_PERSON, observations, trials

from frictus_service.identification.observation.response import (
    ResponseRows,
    TrialObservations,
)
from frictus_service.study.trial import Trial

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complexfloating]

LAW_ONLY = Design(participants=1, n_tones=5, n_speeds=2, n_forces=1)


def law(rows: ResponseRows) -> FloatArray:
    return CUTOFF_HZ + SLOPE_HZ_PER_MM_S * (np.clip(rows.speed_mm_s, 20.0, 100.0) - 60.0)


def first_order(rows: ResponseRows, cutoff_hz: FloatArray) -> ComplexArray:
    return 1.0 / (1.0 + 1j * rows.tone_hz / cutoff_hz)


def test_friction_and_mobility_follow_the_law(tmp_path: Path, rng: np.random.Generator) -> None:
    for trial in observations(tmp_path, (), int(rng.integers(2**31)), LAW_ONLY):
        rows = trial.rows
        s = 2j * np.pi * rows.tone_hz
        error = np.median(rows.friction_response / (GAIN_N * first_order(rows, law(rows))))
        assert abs(abs(error) - 1.0) < 0.005
        assert abs(np.degrees(np.angle(error))) < 0.3
        mobility = np.median(rows.mobility * (0.0015 * s**2 + 1.3 * s + 444.0) / s)
        assert abs(abs(mobility) - 1.0) < 0.008
        assert abs(np.degrees(np.angle(mobility))) < 0.3


def test_a_second_mode_adds_its_share_at_its_frequency(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    share, hz, quality = rng.uniform((0.3, 150.0, 2.0), (1.0, 600.0, 8.0))
    mode = {"share": share, "frequency_hz": hz, "quality": quality}
    hidden = (Hidden("second_mode", mode),)
    for trial in observations(tmp_path, hidden, int(rng.integers(2**31)), LAW_ONLY):
        rows = trial.rows
        s = 2j * np.pi * rows.tone_hz
        first = s / (0.0015 * s**2 + 1.3 * s + 444.0)
        second = share / 1.3 / (1.0 + 1j * quality * (rows.tone_hz / hz - hz / rows.tone_hz))
        error = np.median(rows.mobility / (first + second))
        assert abs(abs(error) - 1.0) < 0.01
        assert abs(np.degrees(np.angle(error))) < 0.5


Expected = Callable[[ResponseRows, float, float], ComplexArray]

RATIOS: dict[str, Expected] = {
    "speed_dependent_cutoff": lambda r, v, t: (
        first_order(r, law(r) + v * (r.speed_mm_s - 60.0)) / first_order(r, law(r))
    ),
    "force_dependent_cutoff": lambda r, v, t: (
        first_order(r, law(r) * (r.normal_force_n / 0.4) ** v) / first_order(r, law(r))
    ),
    "cutoff_drift": lambda r, v, t: (
        first_order(r, law(r) * np.exp(v * t)) / first_order(r, law(r))
    ),
    "speed_dependent_gain": lambda r, v, t: (r.speed_mm_s / 60.0) ** v + 0j,
    "force_dependent_gain": lambda r, v, t: (r.normal_force_n / 0.4) ** v + 0j,
    "gain_drift": lambda r, v, t: np.full(r.tone_hz.size, np.exp(v * t) + 0j),
    "direction_asymmetry": lambda r, v, t: 1.0 + v * r.direction + 0j,
    "charge_leakage": lambda r, v, t: 1j * r.tone_hz / (1j * r.tone_hz + v),
    "channel_delay": lambda r, v, t: np.exp(-2j * np.pi * r.tone_hz * v),
    "mount_resonance_shift": lambda r, v, t: (
        mount(1714.0 * (1.0 + v)).at(2j * np.pi * r.tone_hz)
        / mount().at(2j * np.pi * r.tone_hz)
    ),
    "fractional_rolloff": lambda r, v, t: first_order(r, law(r)) ** v,
}


@pytest.fixture(scope="module")
def plain(
    tmp_path_factory: pytest.TempPathFactory, module_seed: int
) -> tuple[int, list[TrialObservations]]:
    """A study in which nothing is hidden, and its seed."""
    folder = tmp_path_factory.mktemp("plain")
    return module_seed, observations(folder, (), module_seed)


@pytest.mark.parametrize("name", RATIOS)
def test_what_is_hidden_has_its_size(
    name: str,
    plain: tuple[int, list[TrialObservations]],
    tmp_path: Path,
    rng: np.random.Generator,
) -> None:
    check_size(cause(name, 2.0, rng), plain, tmp_path)


def test_a_channel_may_be_early(
    plain: tuple[int, list[TrialObservations]], tmp_path: Path, rng: np.random.Generator
) -> None:
    check_size(cause("channel_delay", 2.0, rng, sign=-1.0), plain, tmp_path)


def check_size(
    hidden: Hidden, plain: tuple[int, list[TrialObservations]], folder: Path
) -> None:
    seed, nothing = plain
    value = next(iter(hidden.parameters.values()))
    effects = []
    errors = []
    something = observations(folder, (hidden,), seed)
    for with_it, without in zip(something, nothing, strict=True):
        minutes = without.info.order / 3.0
        expected = RATIOS[hidden.name](without.rows, value, minutes)
        ratio = with_it.rows.friction_response / without.rows.friction_response
        errors.append(np.abs(ratio / expected - 1.0).mean())
        effects.append(np.abs(expected - 1.0).mean())
    assert np.mean(errors) < 0.05 * np.mean(effects) + 1e-4


def test_gain_follows_the_position(tmp_path: Path, rng: np.random.Generator) -> None:
    seed = int(rng.integers(2**31))
    design = Design(participants=1, n_tones=3, n_speeds=1, n_forces=2)
    hidden = cause("position_dependent_gain", 1.0, rng)
    pairs = zip(
        observations(tmp_path, (hidden,), seed, design),
        observations(tmp_path, (), seed, design),
        strict=True,
    )
    third, change = np.concatenate(
        [
            (p.rows.third, np.log(np.abs(w.rows.friction_response / p.rows.friction_response)))
            for w, p in pairs
        ],
        axis=1,
    )
    # The steady part of a stroke of 60 mm at 60 mm/s, in thirds.
    apart_mm = 2.0 / 3.0 * 51.0
    slope = (change[third == 2].mean() - change[third == 0].mean()) / apart_mm
    assert slope == pytest.approx(hidden.parameters["per_mm"], rel=0.1)


@pytest.mark.parametrize("name", ["residual_quadratic", "amplitude_compression"])
def test_harmonics_have_their_size(name: str, tmp_path: Path, rng: np.random.Generator) -> None:
    hidden = cause(name, 4.0, rng)
    share = hidden.parameters["share"]
    design = Design(participants=1, n_tones=2, n_speeds=1, n_forces=1, tones_hz=(60.0, 400.0))
    order = 2 if name == "residual_quadratic" else 3
    expected = share if order == 2 else -share / (1.0 + share)
    for trial in trials(tmp_path, (hidden,), int(rng.integers(2**31)), design):
        assert harmonic(trial, order) == pytest.approx(expected, rel=0.03, abs=2e-5)


def harmonic(trial: Trial, order: int) -> float:
    """Return the amplitude of a harmonic of the drive over the fundamental, with its sign."""
    first, last = _cruise(trial)
    time_s = np.arange(first, last) / trial.info.sample_rate_hz
    at_hz = trial.info.tones_hz[0] * np.array([1.0, order])
    assert trial.voltage_v is not None
    drive = 2.0 * np.square(trial.voltage_v[first:last] / 75.0)
    turn = np.exp(1j * (order - 1) * np.angle(_lines(drive, time_s, at_hz)[0]))
    cutoff_hz = CUTOFF_HZ + SLOPE_HZ_PER_MM_S * (trial.info.speed_mm_s - 60.0)
    response = mount().at(2j * np.pi * at_hz) / (1.0 + 1j * at_hz / cutoff_hz)
    response *= np.sinc(at_hz / 20_000.0) * np.exp(-1j * np.pi * at_hz / 20_000.0)
    lines = _lines(trial.force_n[first:last, 0], time_s, at_hz) / response
    found = complex(lines[1] / lines[0] / turn)
    assert abs(found.imag) < 0.1 * abs(found.real)
    return found.real


def _cruise(trial: Trial) -> tuple[int, int]:
    """Return samples of the longest run in one direction, its ends aside."""
    velocity = np.diff(trial.position_mm[:, 0])
    turns = np.flatnonzero(np.abs(np.diff(np.sign(velocity[velocity != 0.0]))) > 0.0)
    times = trial.position_t_s[:-1][velocity != 0.0]
    edges = np.concatenate([times[:1], times[turns], times[-1:]])
    longest = int(np.argmax(np.diff(edges)))
    begin, end = edges[longest] + 0.15, edges[longest + 1] - 0.15
    return round(begin * trial.info.sample_rate_hz), round(end * trial.info.sample_rate_hz)


def _lines(values: FloatArray, time_s: FloatArray, at_hz: FloatArray) -> ComplexArray:
    """Return the amplitudes of lines beside a trend."""
    turns = 2.0 * np.pi * np.multiply.outer(time_s, at_hz)
    trend = np.vander(np.linspace(-1.0, 1.0, time_s.size), 8)
    basis = np.concatenate([np.cos(turns), -np.sin(turns), trend], axis=1)
    solved = np.linalg.lstsq(basis, values, rcond=None)[0]
    amplitudes: ComplexArray = solved[: at_hz.size] + 1j * solved[at_hz.size : 2 * at_hz.size]
    return amplitudes


def test_mains_and_stick_slip_are_in_the_force(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    seed = int(rng.integers(2**31))
    design = Design(participants=1, n_tones=1, n_speeds=1, n_forces=1, tones_hz=(200.0, 300.0))
    plain = trials(tmp_path, (), seed, design)[0]
    first, last = _cruise(plain)
    time_s = np.arange(first, last) / 20_000.0

    mains = cause("mains_interference", 1.0, rng)
    hummed = trials(tmp_path, (mains,), seed, design)[0].force_n - plain.force_n
    line_hz = np.array([mains.parameters["frequency_hz"]])
    line = _lines(hummed[first:last, 0], time_s, line_hz)
    assert np.abs(line[0]) == pytest.approx(0.004, rel=0.05)

    slip = cause("stick_slip", 1.0, rng)
    slipped = trials(tmp_path, (slip,), seed, design)[0].force_n - plain.force_n
    middle = np.median(np.abs(slipped[first:last, 0]))  # of a saw-tooth: half its peak
    at_speed = 0.06 * np.exp(-plain.info.speed_mm_s / 20.0) * 1.16
    assert middle == pytest.approx(at_speed / 2.0, rel=0.2)


def test_a_skin_that_relaxes_slips_as_often_as_speed_over_its_way(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    """The way is the force that breaks it loose over its stiffness; then the slip."""
    seed = int(rng.integers(2**31))
    design = Design(participants=1, n_tones=1, n_speeds=1, n_forces=1, tones_hz=(200.0, 300.0))
    plain = trials(tmp_path, (), seed, design)[0]
    first, last = _cruise(plain)
    values = {"amplitude_n": 0.5, "stiffness_n_per_mm": 0.05}
    hidden = Hidden("stick_slip", values, "relaxing")
    loads = trials(tmp_path, (hidden,), seed, design)[0].force_n - plain.force_n
    load = loads[first:last, 0]
    load = load * np.sign(np.mean(np.diff(load) > 0.0) - 0.5)  # it is loaded for longest
    peak_n = 0.5 * np.exp(-plain.info.speed_mm_s / 20.0) * 1.16
    assert np.abs(load).max() == pytest.approx(peak_n, rel=0.2)
    fallen = np.diff(np.flatnonzero((load[:-1] > 0.0) & (load[1:] <= 0.0))) / 20_000.0
    way_mm = 2.0 * peak_n / 1.16 / 0.05
    expected_s = way_mm / plain.info.speed_mm_s + 0.008
    assert np.median(fallen) == pytest.approx(expected_s, rel=0.2)


@pytest.mark.parametrize(("name", "form"), OTHER_FORMS)
def test_other_forms_are_not_the_catalogues(name: str, form: str) -> None:
    other = _signature(hide(World(), Hidden(name, OTHER_FORMS[name, form], form)))
    known = _signature(hide(World(), Hidden(name, REALISTIC[name])))
    likeness = abs(other @ known) / np.sqrt((other @ other) * (known @ known))
    assert np.abs(other).max() > 0.002
    assert likeness < 0.97


def _signature(world: World) -> FloatArray:
    """Return what a world changes, over conditions and tones; logarithms, own mean aside."""
    axes = np.meshgrid(
        [20.0, 47.0, 73.0, 100.0], [0.2, 0.4, 0.6], [10.0, 35.0, 60.0], [-1, 1.0]
    )
    speeds, forces, places, senses = (axis.ravel() for axis in axes)
    kept = [Moment(speeds, forces, places, senses, minutes) for minutes in (0.0, 7.0, 19.0)]
    law = [CUTOFF_HZ + SLOPE_HZ_PER_MM_S * (moment.speed_mm_s - 60.0) for moment in kept]
    gain, cutoff = [np.zeros(moment.speed_mm_s.size) for moment in kept], list(law)
    for factor in world.gains:
        gain = [now + np.log(factor(moment)) for now, moment in zip(gain, kept, strict=True)]
    for change in world.cutoffs:
        cutoff = [change(moment, now) for now, moment in zip(cutoff, kept, strict=True)]
    of_cutoff = np.log(np.concatenate(cutoff) / np.concatenate(law))
    of_gain = np.concatenate(gain)
    tones = np.array([40.0, 130.0, 400.0, 1000.0, 1700.0])
    filtered = np.log(_filters(world, tones))
    drive = np.linspace(0.0, 1.0, 9)
    mapped = [drive + 0.0 for _ in range(9)]
    for each in world.maps:
        mapped = [
            each(drive, minute, tone)
            for minute in (0.0, 7.0, 19.0)
            for tone in (40.0, 400.0, 1700.0)
        ]
    parts = [
        of_gain - of_gain.mean(),
        of_cutoff - of_cutoff.mean(),
        filtered.real - filtered.real.mean(),
        filtered.imag,
        np.concatenate(mapped) - np.tile(drive, 9),
    ]
    return np.concatenate(parts)


def _filters(world: World, tones_hz: FloatArray) -> ComplexArray:
    s = 1j * tones_hz / CUTOFF_HZ
    response = world.rolloff.at(s) * (1.0 + s)
    if world.shelf is not None:
        corner = world.shelf.corner_hz
        response *= 1.0 - world.shelf.share * corner / (1j * tones_hz + corner)
    return response


def test_an_unknown_mode_stands_at_its_frequency(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    seed = int(rng.integers(2**31))
    design = Design(participants=1, n_tones=3, n_speeds=1, n_forces=1, near_hz=180.0)
    hidden = Hidden("hidden_mode", {"depth": 0.26, "frequency_hz": 180.0}, "unknown")
    pairs = zip(
        observations(tmp_path, (hidden,), seed, design),
        observations(tmp_path, (), seed, design),
        strict=True,
    )
    for with_it, plain in pairs:
        s = 1j * plain.rows.tone_hz / 180.0
        expected = 1.0 + 0.26 * (s / 8.0) / (s**2 + s / 8.0 + 1.0)
        ratio = with_it.rows.friction_response / plain.rows.friction_response
        assert np.abs(ratio / expected - 1.0).mean() < 0.003


def test_a_wholly_different_mount_is_what_it_says(
    plain: tuple[int, list[TrialObservations]], tmp_path: Path
) -> None:
    seed, nothing = plain
    values = {"resonance_hz": 900.0, "damping": 0.05}
    found = observations(tmp_path, (Hidden("other_mount", values, "unknown"),), seed)
    for with_it, without in zip(found, nothing, strict=True):
        s = 2j * np.pi * without.rows.tone_hz
        expected = other_mount(900.0, 0.05).at(s) / mount().at(s)
        ratio = with_it.rows.friction_response / without.rows.friction_response
        assert np.abs(ratio / expected - 1.0).mean() < 0.01


def test_the_same_seeds_give_the_same_study(tmp_path: Path, rng: np.random.Generator) -> None:
    seed = int(rng.integers(2**31))
    design = Design(participants=1, n_tones=1, n_speeds=1, n_forces=1)
    one, two = (trials(tmp_path, (), seed, design)[0] for _ in range(2))
    assert one.sha256 == two.sha256


def test_a_lifelike_finger_strokes_at_its_speed_and_rests_at_its_turns(
    rng: np.random.Generator,
) -> None:
    time_s = np.arange(0.0, 10.0, 1e-3)
    motion = move_lifelike(60.0, 0.4, time_s, rng)
    assert np.gradient(motion.position_mm, time_s) == pytest.approx(
        motion.velocity_mm_s, abs=1.0
    )
    assert 40.0 < np.ptp(motion.position_mm) < 75.0
    sliding = np.abs(motion.velocity_mm_s) > 50.0
    assert np.abs(motion.velocity_mm_s[sliding]).mean() == pytest.approx(60.0, rel=0.03)
    assert 0.5 < sliding.mean() < 0.95
    # Braking by minimum jerk, 0.05 s or longer, is at most 1.875 times the mean of the change.
    steepest = np.abs(np.gradient(motion.velocity_mm_s, time_s)).max()
    assert steepest < 1.875 * 1.2 * 60.0 / 0.05


def test_a_lifelike_study_lacks_trials_and_has_tones_of_each_persons_own(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    design = Design(participants=2, n_tones=3, n_speeds=2, n_forces=2, lifelike=True)
    found = trials(tmp_path, (), int(rng.integers(2**31)), design)
    assert 6 < len(found) < 24
    assert max(trial.info.order for trial in found) < 12
    first, second = (
        {trial.info.tones_hz for trial in found if trial.info.participant == name}
        for name in ("P01", "P02")
    )
    assert first.isdisjoint(second)


def test_reports_may_be_late(rng: np.random.Generator) -> None:
    time_s = np.arange(0.0, 3.0, 1e-3)
    ramp = Motion(60.0 * time_s, np.full(time_s.size, 60.0), np.full(time_s.size, 0.4))
    place, at_s = reports(ramp, time_s, 2.0, rng, late_s=0.04)
    was_s = at_s - 0.04 + LEAD_SAMPLES / RATE_HZ
    assert place[:, 0] == pytest.approx(60.0 * was_s, abs=0.051)


def test_three_tones_at_once_answer_as_one_does(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    design = Design(participants=1, n_tones=5, n_speeds=1, n_forces=1, tones_per_trial=3)
    found: list[TrialObservations] = observations(
        tmp_path, (), int(rng.integers(2**31)), design
    )
    assert all(len(trial.info.tones_hz) == 3 for trial in found)
    for trial in found:
        rows = trial.rows
        error = rows.friction_response / (GAIN_N * first_order(rows, law(rows)))
        assert np.median(np.abs(error - 1.0)) < 0.01


def test_nothing_in_the_file_tells_the_truth(tmp_path: Path, rng: np.random.Generator) -> None:
    hidden = cause("channel_delay", 1.0, rng)
    design = Design(participants=1, n_tones=1, n_speeds=1, n_forces=1)
    found = trials(tmp_path, (hidden,), int(rng.integers(2**31)), design)[0]
    plain = trials(tmp_path, (), int(rng.integers(2**31)), design)[0]
    assert found.force_skew_s == plain.force_skew_s
    assert found.info.participant == plain.info.participant
    assert ONE_PERSON.participants == 1
