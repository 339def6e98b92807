"""Rows become independent readings: sums are kept, scatters come back, phases wrap."""

from dataclasses import fields

import numpy as np
import pytest

from frictus_hardware.arrays import FloatArray
from frictus_service.discovery.evidence.residuals import (
    HARMONICS,
    LARGE,
    LEAST_IN_GROUP,
    LINE_N2,
    LOW,
    RESPONSE,
    TONES,
    Compared,
    Layout,
    accuracy_of,
    huber,
    lay_out,
    reduce,
    scatters,
    trials_of,
)

N_TRIALS, N_TONES, N_STRETCHES = 40, 3, 6
N_ROWS = N_TRIALS * N_TONES * N_STRETCHES
TRIAL = np.repeat(np.arange(N_TRIALS), N_TONES * N_STRETCHES)
TONE = np.tile(np.repeat(np.arange(N_TONES), N_STRETCHES), N_TRIALS)
LENGTHS = [N_TRIALS, *2 * [N_TRIALS * N_TONES], *2 * [N_ROWS], *4 * [N_TRIALS * N_TONES]]
LENGTHS += 3 * [N_TRIALS]


def random(rng: np.random.Generator) -> Compared:
    shapes = [(N_ROWS,), (N_ROWS,), (N_ROWS, 2), (N_ROWS, 2), *3 * [(N_TRIALS,)]]
    names = [field.name for field in fields(Compared)]
    return Compared(
        **{name: rng.normal(0.0, 0.1, shape) for name, shape in zip(names, shapes, strict=True)}
    )


def parts(readings: FloatArray) -> list[FloatArray]:
    return np.split(readings, np.cumsum(LENGTHS)[:-1])


def test_sizes_are_split_into_trial_tone_and_stretch(rng: np.random.Generator) -> None:
    data = random(rng)
    trial, tone, _, stretch, *_ = parts(reduce(lay_out(TRIAL, TONE, data), data))
    np.testing.assert_allclose(
        np.repeat(trial, N_TONES * N_STRETCHES) + np.repeat(tone, N_STRETCHES) + stretch,
        data.size,
    )
    np.testing.assert_allclose(tone.reshape(N_TRIALS, N_TONES).sum(axis=1), 0.0, atol=1e-12)
    np.testing.assert_allclose(stretch.reshape(-1, N_STRETCHES).sum(axis=1), 0.0, atol=1e-12)


def test_contact_is_in_the_trials_alone(rng: np.random.Generator) -> None:
    data, layout = random(rng), lay_out(TRIAL, TONE, random(rng))
    contact = rng.normal(0.0, 1.0, N_TRIALS)
    moved = Compared(
        **{field.name: getattr(data, field.name) for field in fields(Compared)}
        | {"size": data.size + contact[TRIAL]}
    )
    first, *others = parts(reduce(layout, moved) - reduce(layout, data))
    np.testing.assert_allclose(first, contact)
    np.testing.assert_allclose(np.concatenate(others), 0.0, atol=1e-12)


def test_readings_are_linear(rng: np.random.Generator) -> None:
    one, other = random(rng), random(rng)
    layout = lay_out(TRIAL, TONE, one)
    np.testing.assert_allclose(
        reduce(layout, one - other), reduce(layout, one) - reduce(layout, other), atol=1e-12
    )
    np.testing.assert_allclose(reduce(layout, one / 4.0), reduce(layout, one) / 4.0)


def test_phases_are_compared_within_half_a_turn() -> None:
    zeros = Compared.zeros(1, 1)
    for phase, other, difference in ((3.0, -3.0, 6.0 - 2.0 * np.pi), (0.2, -0.1, 0.3)):
        one, two = (Compared(*zeros_with(zeros, np.array([x]))) for x in (phase, other))
        assert (one - two).phase[0] == pytest.approx(difference)


def zeros_with(zeros: Compared, phase: FloatArray) -> list[FloatArray]:
    return [
        phase if field.name == "phase" else getattr(zeros, field.name)
        for field in fields(Compared)
    ]


def test_what_is_not_seen_is_no_reading(rng: np.random.Generator) -> None:
    data = random(rng)
    data.line50[:] = np.nan
    data.low[7] = np.nan
    data.second[TONE == 1] = np.nan
    layout = lay_out(TRIAL, TONE, data)
    readings = reduce(layout, data)
    assert np.isfinite(readings).all()
    assert readings.size == sum(LENGTHS) - N_TRIALS - 1 - 2 * N_TRIALS
    for each in (layout.part, trials_of(layout), accuracy_of(layout)):
        assert each.shape == readings.shape


def test_trials_with_one_tone_are_counted_once(rng: np.random.Generator) -> None:
    """Its size is the trial's: the difference of tone and trial, which is 0, says nothing."""
    rows = np.arange(N_TRIALS)
    full = random(rng)
    data = Compared(
        full.size[rows], full.phase[rows], full.second[rows], full.third[rows], *3 * [full.low]
    )
    layout = lay_out(rows, rows % N_TONES, data)
    readings = reduce(layout, data)
    assert readings.size == N_TRIALS * (1 + 1 + 4 + 3)
    np.testing.assert_allclose(readings[:N_TRIALS], data.size)
    assert len(set(layout.part[:N_TRIALS])) == N_TONES  # each tone scatters as it does


def test_trials_and_accuracy_of_readings(rng: np.random.Generator) -> None:
    layout = lay_out(TRIAL, TONE, random(rng))
    per_trial = np.bincount(trials_of(layout))
    assert set(per_trial) == {sum(LENGTHS) // N_TRIALS}
    best = [set(each.tolist()) for each in parts(accuracy_of(layout))]
    assert best == [*5 * [{RESPONSE}], *4 * [{HARMONICS}], {LINE_N2}, {LINE_N2}, {LOW}]


def test_scatters_come_back(rng: np.random.Generator) -> None:
    layouts = [lay_out(TRIAL, TONE, random(rng)) for _ in range(4)]
    names = np.unique(layouts[0].part)
    true = dict(zip(names.tolist(), rng.uniform(0.01, 0.1, names.size), strict=True))
    expected = [np.array([true[part] for part in one.part.tolist()]) for one in layouts]
    readings = [rng.normal(0.0, sd) for sd in expected]
    outliers = rng.random(readings[0].size) < 0.02
    readings[0][outliers] *= 30.0
    found = scatters(layouts, readings)
    for one, sd in zip(found, expected, strict=True):
        np.testing.assert_allclose(one, sd, rtol=0.45)  # the median of 160 in the smallest
    whole = np.concatenate([r / s for r, s in zip(readings, found, strict=True)])
    assert 0.9 < np.median(np.abs(whole)) / 0.6745 < 1.1


def test_few_readings_share_the_scatter_of_their_kind(rng: np.random.Generator) -> None:
    n = LEAST_IN_GROUP - 1
    part = np.repeat([TONES, TONES + 1, TONES + 2], [n, 100, 100])
    none = np.zeros(0, dtype=np.int64)
    layout = Layout(none, none, none, none, np.ones(part.size, dtype=np.bool_), part, 0)
    signs: FloatArray = rng.choice(np.array([-1.0, 1.0]), part.size)
    (found,) = scatters([layout], [np.where(part == TONES, 5.0, 0.1) * signs])
    np.testing.assert_allclose(found, 0.1 / 0.6745)


def test_outliers_weigh_less() -> None:
    scatter = np.full(4, 0.2)
    weight = huber(np.array([0.0, -0.5, 1.0, -50.0]), scatter)
    np.testing.assert_allclose(weight, np.sqrt([1.0, 1.0, LARGE / 5.0, LARGE / 250.0]))
