"""Everything that passes the wire's ranges, drawn by hypothesis."""

from typing import Any

import numpy as np
from hypothesis import strategies as st

from frictus.textures import (
    PERIOD_MM,
    PERIOD_S,
    Beta,
    Component,
    Profile,
    Region,
    Slope,
    Spectrum,
)


def reals(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high) | st.sampled_from([low, high])


def one_of_the_two(first: tuple[str, Any], second: tuple[str, Any]) -> st.SearchStrategy[Any]:
    return st.fixed_dictionaries({first[0]: first[1]}) | st.fixed_dictionaries(
        {second[0]: second[1]}
    )


component = st.builds(
    lambda frequency, amplitude_n, phase_rad: Component(
        amplitude_n=amplitude_n, phase_rad=phase_rad, **frequency
    ),
    one_of_the_two(("cycles_per_mm", reals(1e-3, 1e3)), ("hz", reals(0.01, 1e4))),
    reals(0.0, 10.0),
    reals(-1e4, 1e4),
)
angle_deg = reals(-360.0, 360.0)
speed_mm_s = st.none() | reals(1.0, 1e3)
seed = st.integers(0, 2**63 - 1)
texture = (
    st.builds(
        lambda components, angle_deg: Spectrum(components=components, angle_deg=angle_deg),
        st.lists(component, min_size=1, max_size=4),
        angle_deg,
    )
    | st.builds(
        lambda period, friction_n, angle_deg: Profile(
            friction_n=friction_n, angle_deg=angle_deg, **period
        ),
        one_of_the_two(("period_mm", reals(*PERIOD_MM)), ("period_s", reals(*PERIOD_S))),
        st.lists(reals(-10.0, 10.0), min_size=2, max_size=40),
        angle_deg,
    )
    | st.builds(
        Beta,
        alpha=reals(1e-3, 1e3),
        beta=reals(1e-3, 1e3),
        rms_n=reals(1e-6, 10.0),
        scale=reals(1e-9, 1e9),
        seed=seed,
        speed_mm_s=speed_mm_s,
    )
    | st.builds(
        Slope,
        peak_hz=reals(20.0, 1e3),
        low_order=st.integers(1, 8),
        high_order=st.integers(1, 8),
        rms_n=reals(1e-6, 10.0),
        seed=seed,
        speed_mm_s=speed_mm_s,
    )
)
interval_mm = (
    st.tuples(reals(-1e4, 1e4), reals(-1e4, 1e4))
    .map(sorted)
    .filter(lambda pair: pair[0] < pair[1])
)
region = st.builds(
    lambda texture, x_mm, y_mm, gain, fade: Region(
        texture=texture, x_mm=tuple(x_mm), y_mm=tuple(y_mm), gain=gain, edge_fade_mm=fade
    ),
    texture,
    interval_mm | st.just((-1e3, 1e3)),
    st.just((-1e3, 1e3)),
    reals(0.0, 100.0),
    reals(0.0, 50.0),
)
coordinate = reals(-1e3, 1e3) | st.sampled_from([np.nan, np.inf, 5e-324, 1e308])
