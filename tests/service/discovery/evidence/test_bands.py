"""What windows show of a mount that rings."""

import numpy as np

from frictus_hardware.physics.linear import Mount
from frictus_service.discovery.evidence.bands import WINDOW_S, Bands

RATE_HZ = 20_000.0
LENGTH = round(WINDOW_S * RATE_HZ)


def test_the_mount_is_what_hann_windows_make_of_it() -> None:
    """The mean of a steady response over a window's spectrum, which is not its middle."""
    mount = Mount().lateral
    bands = Bands.of(LENGTH, RATE_HZ, mount)
    away = np.linspace(-4.0, 4.0, 801)
    window = 0.5 * np.sinc(away) + 0.25 * (np.sinc(away - 1.0) + np.sinc(away + 1.0))
    weight = np.square(window) / np.square(window).sum()
    apart_hz = away / WINDOW_S
    seen = mount.frequency_response(np.add.outer(bands.frequency_hz, apart_hz)) @ weight
    np.testing.assert_allclose(bands.mount, seen, rtol=5e-4)
    in_the_middle = mount.frequency_response(bands.frequency_hz)
    assert np.max(np.abs(in_the_middle / seen - 1.0)) > 3e-3


def test_without_a_mount_nothing_is_between() -> None:
    np.testing.assert_array_equal(Bands.of(LENGTH, RATE_HZ, None).mount, 1.0)
