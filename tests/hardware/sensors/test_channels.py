"""Generic analogue channels."""

import numpy as np
import pytest

from frictus_hardware.errors import ConfigError
from frictus_hardware.sensors.analogue import AnalogueChannel


def channel(**changes: object) -> AnalogueChannel:
    settings = {
        "name": "monitor",
        "unit": "V",
        "scale": 50.0,
        "offset": -2.0,
        "range_v": (-10.0, 10.0),
    }
    return AnalogueChannel(**(settings | changes))  # type: ignore[arg-type]


def test_value_and_range() -> None:
    volts = np.array([0.0, 1.5, -10.0, 10.0, np.nan, 9.99])
    np.testing.assert_allclose(channel().value(volts[:2]), [-2.0, 73.0])
    assert channel().out_of_range(volts).tolist() == [False, False, True, True, True, False]


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"scale": 0.0}, "scale is 0"),
        ({"scale": np.nan}, "scale is nan"),
        ({"offset": np.inf}, "offset is inf"),
        ({"range_v": (1.0, 1.0)}, "range_v is 1.0 to 1.0"),
        ({"range_v": (-np.inf, 1.0)}, "finite"),
    ],
)
def test_what_cannot_be_a_channel(changes: dict[str, object], why: str) -> None:
    with pytest.raises(ConfigError, match=f"channel monitor: .*{why}|channel monitor: {why}"):
        channel(**changes)
