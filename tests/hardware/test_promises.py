"""What a backend returns is refused, or made what was promised, before anything reads it."""

from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np
import pytest

from frictus_hardware import Exchange, SimulatedConfig, TouchReport
from frictus_hardware.errors import BackendError
from frictus_hardware.promises import as_promised

Change = Callable[[Exchange], Exchange]
N: Final = 100
REPORT: Final = TouchReport(3.0, 20.0, 10.0, in_contact=True)


def changed(**values: object) -> Change:
    return lambda exchange: replace(exchange, **values)  # type: ignore[arg-type]


def taken(change: Change) -> tuple[Exchange, Exchange]:
    """Return what a backend returned with one thing changed, and what became of it."""
    with SimulatedConfig(clock="virtual").make() as rig:
        play_sample = rig.next_play_sample
        returned = change(rig.exchange(np.zeros(N)))
        return returned, as_promised(returned, N, play_sample, rig.info)


MISFITS: Final[dict[str, Change]] = {
    "force_n of shape (50, 3)": lambda e: replace(e, force_n=e.force_n[:50]),
    "force_n of shape (3, 100)": lambda e: replace(e, force_n=e.force_n.T),
    "force_n of shape (100, 6)": changed(force_n=np.zeros((N, 6))),
    "accel_m_s2 of shape (3, 100)": lambda e: replace(e, accel_m_s2=e.accel_m_s2.T),
    "accel_m_s2 of shape (50, 3)": lambda e: replace(e, accel_m_s2=e.accel_m_s2[:50]),
    "voltage_v of shape (200,)": changed(voltage_v=np.zeros(2 * N)),
    "voltage_v of shape (0,)": changed(voltage_v=np.zeros(0)),
    "applied_v of shape (100, 1)": changed(applied_v=np.zeros((N, 1))),
    "applied_v that is not finite": changed(applied_v=np.full(N, np.nan)),
    "force_n of type list": lambda e: replace(e, force_n=e.force_n.tolist()),
    "force_n of type complex128": changed(force_n=np.zeros((N, 3), complex)),
    "voltage_v of type object": changed(voltage_v=np.zeros(N, object)),
    "NoneType from exchange": lambda _e: None,  # type: ignore[dict-item, return-value]
    "touches of type NoneType": changed(touches=None),
    "a TouchReport of numbers": changed(touches=((1.0, 2.0, 3.0, True),)),
    "x_mm='3'": changed(touches=(replace(REPORT, x_mm="3"),)),  # type: ignore[arg-type]
    "in_contact=None": changed(touches=(replace(REPORT, in_contact=None),)),  # type: ignore[arg-type]
    "first_sample = 0.0": changed(first_sample=0.0),
    "first_sample 7 with 0 samples lost": changed(first_sample=7),
    "play_sample 0": changed(play_sample=0),
    "underrun_samples = -1": changed(underrun_samples=-1),
    "underrun_samples = 4611686018427387904": changed(underrun_samples=1 << 62),
    "first_sample 0 with 4611686018427387904": changed(overrun_samples=1 << 62),
    "clipped_samples = None": changed(clipped_samples=None),
    "margin_samples = nan": changed(margin_samples=float("nan")),
    "truth.friction_n of shape (3,)": lambda e: replace(
        e,
        truth=replace(e.truth, friction_n=np.zeros(3)),  # type: ignore[type-var]
    ),
}


@pytest.mark.parametrize(("told", "change"), MISFITS.items(), ids=MISFITS)
def test_what_no_backend_may_return_is_refused_with_what_it_was(
    told: str, change: Change
) -> None:
    with pytest.raises(BackendError) as refused:
        taken(change)
    assert told in str(refused.value)
    assert "the backend simulated returned" in str(refused.value)
    assert str(refused.value).endswith("is accepted")


def test_an_exchange_as_promised_is_passed_on_as_it_is() -> None:
    returned, passed_on = taken(lambda exchange: exchange)
    assert passed_on is returned


@pytest.mark.parametrize("kind", ["f4", "i2", ">f8"])
def test_numbers_of_another_type_are_made_those_that_compiled_code_reads(kind: str) -> None:
    force = np.ones((N, 3)).astype(kind)
    _, passed_on = taken(changed(force_n=np.asfortranarray(force)))
    assert passed_on.force_n.dtype == np.dtype(float)
    assert passed_on.force_n.dtype.isnative
    assert passed_on.force_n.flags.c_contiguous
    assert passed_on.force_n.flags.writeable
    assert np.array_equal(passed_on.force_n, np.ones((N, 3)))


def test_reports_in_numbers_of_numpy_are_made_pythons_own() -> None:
    report = TouchReport(np.int64(3), np.float32(20.0), np.float64(10.0), np.bool_(True))  # type: ignore[arg-type]
    _, passed_on = taken(changed(touches=(report,)))
    (made,) = passed_on.touches
    assert made == REPORT
    kinds = [type(value) for value in (made.measured_sample, made.x_mm, made.y_mm)]
    assert [*kinds, type(made.in_contact)] == [float, float, float, bool]


@pytest.mark.parametrize("number", [np.nan, np.inf, 1e300])
def test_what_a_sensor_says_may_be_any_number(number: float) -> None:
    returned, passed_on = taken(changed(force_n=np.full((N, 3), number)))
    assert passed_on is returned
