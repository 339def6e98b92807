"""How fast a finger went in a sweep, from reports in steps of a tenth of a millimetre."""

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_service.discovery.evidence.sweep_speed import with_likeliest_speed
from frictus_service.discovery.evidence.window_spectra import Channels
from frictus_service.identification.observation.sweeps import Sweep
from frictus_service.identification.observation.touch_path import path_of
from frictus_service.study.trial import StudyInfo, Trial, TrialInfo

RATE_HZ = 2_000.0
SWEEP_S = 0.9
SPEED_MM_S = 21.0
SWEEPS = 200


def wandering(rng: np.random.Generator) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the true speed at every sample, reports, and when they were so."""
    time_s = np.arange(int(SWEEP_S * RATE_HZ)) / RATE_HZ
    hz, turns = rng.uniform(0.3, 3.0, (3, 1)), rng.uniform(0.0, 2.0 * np.pi, (3, 1))
    wander = np.cos(2.0 * np.pi * hz * time_s + turns).sum(axis=0) / np.sqrt(1.5)
    speed = SPEED_MM_S * (1.0 + 0.02 * wander)
    x_mm = rng.uniform(5.0, 6.0) + np.cumsum(speed) / RATE_HZ
    at_s = np.arange(0.01, SWEEP_S - 0.01, 1.0 / 60.0)
    place = np.column_stack([np.interp(at_s, time_s, x_mm), np.full(at_s.size, 20.0)])
    return speed, np.round(place, 1), at_s


def thirds(speed: FloatArray) -> FloatArray:
    """Return the means of the thirds, less that of the sweep."""
    means: FloatArray = speed.reshape(3, -1).mean(axis=1)
    return means - float(means.mean())


def test_what_is_wrong_of_a_speed_does_not_go_with_it(rng: np.random.Generator) -> None:
    """By polynomials through the reports, a slope over the speed was too small."""
    true: list[FloatArray] = []
    plain: list[FloatArray] = []
    likeliest: list[FloatArray] = []
    for _ in range(SWEEPS):
        speed, place_mm, at_s = wandering(rng)
        path = path_of(place_mm, at_s, speed.size, RATE_HZ)
        sweep = Sweep(1, 0.1, SWEEP_S - 0.1)
        found = with_likeliest_speed(path, place_mm, at_s, RATE_HZ, [sweep])
        cut = slice(int(0.1 * RATE_HZ), int((SWEEP_S - 0.1) * RATE_HZ) - 1)
        for into, each in ((true, speed), (plain, path[2]), (likeliest, found)):
            into.append(thirds(each[cut][: each[cut].size // 3 * 3]))
    truth = np.concatenate(true)
    of_plain, of_likeliest = (np.concatenate(each) for each in (plain, likeliest))
    slopes = [each @ truth / (each @ each) for each in (of_plain, of_likeliest)]
    assert slopes[0] < 0.97
    assert 0.99 < slopes[1] < 1.06  # less than there was at most, never more


def test_strays_gaps_and_what_is_too_short_leave_the_path_as_it_is(
    rng: np.random.Generator,
) -> None:
    speed, place_mm, at_s = wandering(rng)
    path = path_of(place_mm, at_s, speed.size, RATE_HZ)
    short = [Sweep(1, 0.2, 0.4)]
    np.testing.assert_array_equal(
        with_likeliest_speed(path, place_mm, at_s, RATE_HZ, short), path[2]
    )
    path[2, 500:700] = 0.0
    place_mm[7], place_mm[20] = np.nan, 40.0
    found = with_likeliest_speed(path, place_mm, at_s, RATE_HZ, [Sweep(1, 0.0, SWEEP_S)])
    assert not found[500:700].any()
    known = path[2] > 0.0
    assert np.abs(found[known] - speed[known]).max() < 1.5


def test_bands_are_at_the_likeliest_speed(rng: np.random.Generator) -> None:
    speed, place_mm, at_s = wandering(rng)
    info = TrialInfo("a", "P01", 1, 0, SPEED_MM_S, 0.4, (), 0.0, RATE_HZ, "2026-01-01T00:00Z")
    force = np.zeros((speed.size, 3))
    trial = Trial(info, None, force, None, None, place_mm, at_s, 0.0, 0.0)
    sweep = Sweep(1, 0.05, SWEEP_S - 0.05)
    seen = Channels.of(trial, StudyInfo("rig", 7_000.0, 75.0), [sweep]).speed_mm_s
    path = path_of(place_mm, at_s, speed.size, RATE_HZ)
    likeliest = with_likeliest_speed(path, place_mm, at_s, RATE_HZ, [sweep])
    np.testing.assert_array_equal(seen, likeliest)
    assert np.abs(seen - path[2]).max() > 0.01
