"""Forces from gauges: tare, wrench and overload."""

import numpy as np
import pytest
from tests.hardware.sensors.calibration_file import CalibrationFile, gauge_matrix

from frictus_hardware.errors import SensorError
from frictus_hardware.sensors.analogue import overload_fault, overloaded, tare, wrench
from frictus_hardware.sensors.ati import parse_calibration

CALIBRATION = parse_calibration(CalibrationFile(gauge_matrix()).text().encode(), "a.cal")
BIAS_V = np.array([0.3, -0.2, 0.5, 1.0, -0.4, 0.1])


def gauges_v(loads: np.ndarray) -> np.ndarray:
    return BIAS_V + np.linalg.solve(gauge_matrix(), loads.T).T


def test_the_wrench_that_bent_the_gauges_comes_back(rng: np.random.Generator) -> None:
    loads = rng.normal(size=(50, 6)) * [1.0, 1.0, 1.0, 0.01, 0.01, 0.01]
    np.testing.assert_allclose(wrench(CALIBRATION, gauges_v(loads), BIAS_V), loads, atol=1e-9)


def test_a_tare_through_noise_and_the_same_load_after_it(rng: np.random.Generator) -> None:
    noise_v = rng.normal(scale=1e-3, size=(10_000, 6))
    bias_v = tare(CALIBRATION, BIAS_V + noise_v)
    # Six standard errors of the mean.
    np.testing.assert_allclose(bias_v, BIAS_V, atol=6.0 * 1e-3 / 100.0)


@pytest.mark.parametrize("axis", range(3))
def test_a_tare_during_which_the_load_moves_is_refused(axis: int) -> None:
    loads = np.zeros((1000, 6))
    loads[:, axis] = np.linspace(0.0, 0.1, 1000)
    with pytest.raises(SensorError, match=f"along {'xyz'[axis]} .* moved by 0.0901 N"):
        tare(CALIBRATION, gauges_v(loads))
    tare(CALIBRATION, gauges_v(loads), moved_limit_n=0.1)


@pytest.mark.parametrize("value", [10.0, -9.95, np.nan, np.inf])
def test_a_tare_out_of_range_or_too_short_is_refused(value: float) -> None:
    volts = np.tile(BIAS_V, (1000, 1))
    volts[17, 2] = value
    with pytest.raises(SensorError, match="gauge 3 in 1 of 1000 samples"):
        tare(CALIBRATION, volts)
    with pytest.raises(SensorError, match="at least 100"):
        tare(CALIBRATION, volts[:99])


def test_an_overload_is_told_by_sample_and_gauge() -> None:
    volts = np.tile(BIAS_V, (100, 1))
    assert overload_fault(CALIBRATION, overloaded(CALIBRATION, volts)) is None
    volts[10:22, 1] = 10.0
    volts[11, 5] = -10.4
    volts[12, 5] = np.nan
    at_end = overloaded(CALIBRATION, volts)
    assert np.array_equal(np.flatnonzero(at_end[:, 1]), np.arange(10, 22))
    assert np.array_equal(np.argwhere(at_end[:, 5]).ravel(), [11, 12])
    assert not at_end[:, [0, 2, 3, 4]].any()
    fault = overload_fault(CALIBRATION, at_end)
    assert fault is not None
    for part in ("FT01234", "gauge 2 in 12 of 100", "gauge 6 in 2 of 100", "-10 to 10 V"):
        assert part in fault
