"""Contact from force within a block, from the touch sensor where the force has failed."""

import numpy as np
import pytest

from frictus_hardware.arrays import FloatArray
from frictus_service.synthesis.finger_motion.contact import CONTRADICTED_S, ContactDetector

BLOCK_S = 0.005


def pressing(rng: np.random.Generator, force_n: float) -> FloatArray:
    return force_n + 0.002 * rng.standard_normal(100)


def feed(
    detector: ContactDetector, rng: np.random.Generator, force_n: float, seconds: float
) -> list[bool]:
    said = []
    for _ in range(round(seconds / BLOCK_S)):
        detector.sense(pressing(rng, force_n), BLOCK_S)
        said.append(detector.in_contact)
    return said


def test_the_force_is_earlier_than_the_touch_sensor(rng: np.random.Generator) -> None:
    detector = ContactDetector()
    detector.report(False)
    assert not any(feed(detector, rng, 0.0, 1.0))
    assert feed(detector, rng, 0.2, BLOCK_S) == [True]
    assert all(feed(detector, rng, 0.2, 0.03))
    detector.report(True)
    assert all(feed(detector, rng, 0.2, 1.0))
    assert feed(detector, rng, 0.0, BLOCK_S) == [False]


def test_the_end_of_a_block_decides(rng: np.random.Generator) -> None:
    detector = ContactDetector()
    detector.report(False)
    feed(detector, rng, 0.0, 0.5)
    landing = pressing(rng, 0.0)
    landing[-40:] += 0.2
    detector.sense(landing, BLOCK_S)
    assert detector.in_contact


def test_an_offset_of_the_force_is_no_contact(rng: np.random.Generator) -> None:
    detector = ContactDetector()
    detector.report(False)
    feed(detector, rng, 0.3, 6.0)  # not believed, and learned
    assert not detector.in_contact
    detector.report(True)
    feed(detector, rng, 0.5, 1.0)
    assert detector.by_force
    assert feed(detector, rng, 0.3, BLOCK_S) == [False]


def test_nobody_touches_before_the_touch_sensor_has_reported(rng: np.random.Generator) -> None:
    assert not any(feed(ContactDetector(), rng, 0.4, 1.0))


def test_a_force_sensor_that_reads_nothing_leaves_the_touch_sensor() -> None:
    for dead in (np.zeros(100), np.full(100, 0.37), np.full(100, np.nan), np.full(100, np.inf)):
        detector = ContactDetector()
        for touches in (True, False, True):
            detector.report(touches)
            detector.sense(dead, BLOCK_S)
            assert detector.in_contact == touches
            assert not detector.by_force


def test_a_contradiction_lasts_no_longer_than_a_report(rng: np.random.Generator) -> None:
    detector = ContactDetector()
    detector.report(True)
    feed(detector, rng, 0.4, 1.0)
    said = feed(detector, rng, 0.0, 1.0)  # the sensor lost its load, but not the finger
    assert not said[0]
    assert all(said[round(CONTRADICTED_S / BLOCK_S) :])
    assert not detector.by_force
    feed(detector, rng, 0.4, 1.0)
    assert detector.by_force


def test_a_touch_sensor_that_repeats_one_place_contradicts_nothing(
    rng: np.random.Generator,
) -> None:
    detector = ContactDetector()
    detector.report(True)
    feed(detector, rng, 0.4, 1.0)
    detector.report(True, still=True)
    assert all(feed(detector, rng, 0.4, 1.0))  # a finger at rest
    assert not any(feed(detector, rng, 0.0, 10.0))
    assert detector.by_force
    detector.report(True)  # and moves: it is the force that has failed
    assert all(feed(detector, rng, 0.0, 1.0)[round(CONTRADICTED_S / BLOCK_S) :])
    assert not detector.by_force
    detector.report(True, still=True)
    assert not detector.in_contact
    detector.report(True)
    assert detector.in_contact


def test_where_no_force_is_measured_a_finger_at_rest_is_still_there(
    rng: np.random.Generator,
) -> None:
    detector = ContactDetector()
    detector.report(True, still=True)
    assert detector.in_contact
    detector.sense(np.zeros(100), BLOCK_S)
    assert detector.in_contact


def test_taps_leave_the_force_believed_and_a_rattle_does_not(rng: np.random.Generator) -> None:
    detector = ContactDetector()
    detector.report(False)
    feed(detector, rng, 0.0, 1.0)
    for _ in range(20):  # twice a second, reported 45 ms late
        for touches, force_n in ((True, 0.3), (False, 0.0)):
            feed(detector, rng, force_n, 0.045)
            detector.report(touches)
            feed(detector, rng, force_n, 0.205)
            assert detector.by_force
    detector.report(True)
    for k in range(200):
        feed(detector, rng, 3.0 * np.sin(0.7 * k), BLOCK_S)
    assert not detector.by_force
    assert detector.in_contact


@pytest.mark.parametrize("lost_s", [1.0, 3.0, 10.0])
def test_a_finger_that_the_touch_sensor_lost_is_no_offset(
    rng: np.random.Generator, lost_s: float
) -> None:
    detector = ContactDetector()
    detector.report(False)
    feed(detector, rng, 0.0, 1.0)
    detector.report(True)
    feed(detector, rng, 0.4, 1.0)
    detector.report(False)  # it presses all the same
    assert not any(feed(detector, rng, 0.4, lost_s)[round(CONTRADICTED_S / BLOCK_S) :])
    detector.report(True)
    feed(detector, rng, 0.4, 1.0)
    assert detector.by_force
    for force_n in (0.42, 0.36, 0.3, 0.2):  # as a finger varies; it was an offset of 0.38 N
        assert all(feed(detector, rng, force_n, 1.0))
    assert feed(detector, rng, 0.0, BLOCK_S) == [False]


def test_an_offset_that_went_is_forgotten_at_once(rng: np.random.Generator) -> None:
    detector = ContactDetector()
    detector.report(False)
    feed(detector, rng, 0.4, 4.0)  # lies on the screen, and is taken away
    feed(detector, rng, 0.0, 0.2)
    feed(detector, rng, 0.2, 0.04)
    detector.report(True)
    assert all(feed(detector, rng, 0.2, 1.0))
    assert detector.by_force


@pytest.mark.parametrize("touched", [True, False])
def test_a_touch_sensor_that_says_nothing_contradicts_nothing(
    rng: np.random.Generator, touched: bool
) -> None:
    detector = ContactDetector()
    for reported, force_n in ((False, 0.0), (touched, 0.4 * touched)):
        detector.report(reported)
        feed(detector, rng, force_n, 1.0)
    for pressed in (not touched, touched, not touched):  # and nobody reports it
        for _ in range(round(3.0 * CONTRADICTED_S / BLOCK_S)):
            detector.sense(pressing(rng, 0.4 * pressed), BLOCK_S, reported=False)
            assert detector.by_force
            assert detector.in_contact == pressed
    detector.report(not touched)
    assert all(said == (not touched) for said in feed(detector, rng, 0.4 * (not touched), 1.0))
    assert detector.by_force
