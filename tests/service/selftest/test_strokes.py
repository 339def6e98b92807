"""What strokes tell of a rig's sensors, on rigs that are well and on rigs that are not."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from tests.service.selftest.faulty import BLOCK, FaultyRig, Spoil, quiet_rig

from frictus_hardware.arrays import FloatArray
from frictus_hardware.base import Exchange
from frictus_hardware.sensors.rotation import in_turn
from frictus_hardware.simulated.human import HumanStrokes
from frictus_hardware.simulated.sensors import TouchConfig
from frictus_service.selftest.mounting import REQUEST
from frictus_service.selftest.report import Outcome
from frictus_service.selftest.suite import RigUnderTest, measure_strokes


def stroked(spoil: Spoil = lambda got: got, touch: TouchConfig | None = None) -> Outcome:
    """A real rig as the suite sees it, and somebody who does what is asked."""
    finger = {"finger": HumanStrokes(), "touch": touch or TouchConfig()}
    rig = RigUnderTest(FaultyRig(quiet_rig(**finger), spoil, simulated=False), BLOCK)
    return measure_strokes(rig, lambda request: request == REQUEST)


def through(*, accel: FloatArray | None = None, force: FloatArray | None = None) -> Spoil:
    """The sensors' vectors by way of a matrix."""

    def spoil(got: Exchange) -> Exchange:
        return replace(
            got,
            accel_m_s2=got.accel_m_s2 if accel is None else got.accel_m_s2 @ accel.T,
            force_n=got.force_n if force is None else got.force_n @ force.T,
        )

    return spoil


def test_a_rig_that_is_well_is_said_to_be() -> None:
    outcome = stroked()
    assert outcome.verdict == "ok"
    assert "mounted as configured" in outcome.found
    # HumanStrokes hardly leaves the line along x.
    assert "the angle about x is known within 20° only" in outcome.found
    figures = {figure.name: figure for figure in outcome.figures}
    late = figures["touch reports later than declared"]
    assert late.uncertainty is not None
    assert abs(late.value) < late.uncertainty + 0.5


@pytest.mark.parametrize(
    ("spoil", "verdict", "said", "to_do"),
    [
        (
            through(accel=in_turn((("z", 90.0),))),
            "fail",
            "mounted 90 ± .*° off",
            r'append \[\["x", .*\], \["y", .*\], \["z", -90\.\d\]\] to accel\.rotation',
        ),
        (
            through(accel=in_turn((("y", 15.0),))),
            "warn",
            "mounted 15 ± .*° off",
            "accel.rotation",
        ),
        (through(accel=np.eye(3) / 9.80665), "fail", "0.10. times that of the strokes", "unit"),
        (through(force=-np.eye(3)), "fail", "180° off the motion", "force.channels"),
        (
            through(force=in_turn((("z", 30.0),))),
            "warn",
            "30° off the motion",
            "force.channels",
        ),
        (through(accel=np.zeros((3, 3))), "warn", "does not move with the finger", "again"),
    ],
)
def test_what_is_wrong_is_named(spoil: Spoil, verdict: str, said: str, to_do: str) -> None:
    outcome = stroked(spoil)
    assert outcome.verdict == verdict
    assert re.search(said, outcome.found), outcome.found
    assert re.search(to_do, outcome.to_do), outcome.to_do


def test_the_rotation_that_is_said_mends_the_rig() -> None:
    mounted = in_turn((("x", 25.0), ("y", -40.0), ("z", 120.0)))
    told = stroked(through(accel=mounted)).to_do
    turns = json.loads(told.removeprefix("append ").removesuffix(" to accel.rotation"))
    assert stroked(through(accel=in_turn(turns) @ mounted)).verdict == "ok"


def test_the_latency_that_is_said_mends_the_rig() -> None:
    wrong = TouchConfig(latency_s=0.040, declared_latency_s=0.025)
    outcome = stroked(touch=wrong)
    assert outcome.verdict == "warn"
    assert "older than declared" in outcome.found
    declared_s = 1e-3 * float(outcome.to_do.split("latency of ")[1].split(" ms")[0])
    assert declared_s == pytest.approx(0.040, abs=0.0015)
    mended = TouchConfig(latency_s=0.040, declared_latency_s=declared_s)
    assert stroked(touch=mended).verdict == "ok"


def test_nobody_need_stroke() -> None:
    real = RigUnderTest(FaultyRig(quiet_rig(), lambda got: got, simulated=False), BLOCK)
    assert measure_strokes(real, None).verdict == "skip"
    assert measure_strokes(real, lambda _: False).found == "nobody stroked"
    assert measure_strokes(real, lambda _: True).found == "nobody stroked the screen"
    assert measure_strokes(RigUnderTest(quiet_rig(), BLOCK), None).verdict == "skip"


def test_the_screen_stays_at_zero() -> None:
    rig = FaultyRig(quiet_rig(finger=HumanStrokes()), lambda got: got, simulated=False)
    measure_strokes(RigUnderTest(rig, BLOCK), lambda _: True)
    assert rig.loudest_v == 0.0
