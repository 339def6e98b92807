"""The tests of a rig, one after another. Each opens it, and leaves it closed, at zero."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Final

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_hardware.base import Backend
from frictus_hardware.errors import HardwareError, SensorError
from frictus_service.selftest import loop_back, mounting, noise, step
from frictus_service.selftest.playing import PEAK_V, Played, play
from frictus_service.selftest.report import Outcome

Ask = Callable[[str], bool]
"""Shows a request and waits; False: it will not be done."""

SENSORS: Final[dict[str, Callable[[Played], FloatArray]]] = {
    "force": lambda played: played.force_n,
    "accel": lambda played: played.accel_m_s2,
}


@dataclass(frozen=True, slots=True)
class RigUnderTest:
    """A rig under test.

    Attributes
    ----------
    backend : Backend
        Not open, and nobody else drives it.
    block_samples : int
        Samples of one block.
    stroked : Backend or None
        A simulated rig with the finger that strokes it; None: a person is asked to.
    """

    backend: Backend
    block_samples: int
    stroked: Backend | None = None

    @property
    def peak_v(self) -> float:
        """The strongest that is played, screen volts."""
        return min(PEAK_V, self.backend.info.screen_peak_v)

    def play(self, drive_v: FloatArray) -> Played:
        """Play a drive; see `playing.play`."""
        return play(self.backend, drive_v, self.block_samples)

    def listen(self, seconds: float) -> Played:
        """Take down what is sensed at zero drive."""
        return self.play(np.zeros(round(seconds * self.backend.info.sample_rate_hz)))


def run_tests(rig: RigUnderTest, ask: Ask | None = None) -> Iterator[Outcome]:
    """Run every test; a rig that fails in one is not asked for the next.

    Parameters
    ----------
    rig : RigUnderTest
        Open and disarmed.
    ask : callable or None
        None: nobody is there to tap, and the orientation is left out.
    """
    tests: dict[str, Callable[[], Outcome]] = {
        noise.TEST: lambda: measure_noise(rig),
        loop_back.TEST: lambda: measure_loop_back(rig),
        step.TEST: lambda: measure_step(rig),
    }
    for sensor in SENSORS:
        tests[f"orientation, {sensor}"] = partial(measure_orientation, rig, sensor, ask)
    tests[mounting.TEST] = partial(measure_strokes, rig, ask)
    lost = False
    for name, measure in tests.items():
        if lost:
            yield Outcome(name, "skip", "the rig failed before")
            continue
        try:
            yield measure()
        except HardwareError as error:
            lost = not isinstance(error, SensorError)
            yield Outcome(name, "fail", str(error), _to_do(error))


def measure_noise(rig: RigUnderTest) -> Outcome:
    """Measure the noise floor at zero drive."""
    return noise.judge_noise(rig.listen(noise.SECONDS), rig.backend.info.simulated)


def measure_loop_back(rig: RigUnderTest) -> Outcome:
    """Play tones and compare what the monitor reads."""
    excitation = loop_back.tones(rig.backend.info.sample_rate_hz, rig.peak_v)
    return loop_back.judge_loop_back(rig.play(excitation.drive_v), excitation)


def measure_step(rig: RigUnderTest) -> Outcome:
    """Play steps and see when the monitor moves."""
    info = rig.backend.info
    stairs = step.staircase(info.sample_rate_hz, rig.peak_v)
    played = rig.play(stairs.drive_v)
    return step.judge_step(played, stairs, info.lead_samples, rig.block_samples)


def measure_orientation(rig: RigUnderTest, sensor: str, ask: Ask | None) -> Outcome:
    """Have someone tap in three directions and compare what the sensor says."""
    name = f"orientation, {sensor}"
    if ask is None:
        return Outcome(name, "skip", "nobody is asked to tap when not run on a terminal")
    if rig.backend.info.simulated:
        return Outcome(name, "skip", "nobody can tap a simulated screen")
    taps = []
    for request in mounting.requests(sensor):
        if not ask(request):
            return Outcome(name, "skip", "nobody tapped")
        taps.append(SENSORS[sensor](rig.listen(mounting.TAPS_S)))
    return mounting.judge_orientation(sensor, taps)


def measure_strokes(rig: RigUnderTest, ask: Ask | None) -> Outcome:
    """Have a finger stroke, at zero drive, and compare what the sensors say of it."""
    backend = rig.stroked or rig.backend
    if rig.stroked is None:
        if rig.backend.info.simulated:
            return Outcome(mounting.TEST, "skip", "no finger strokes the simulated screen")
        if ask is None:
            found = "nobody is asked to stroke when not run on a terminal"
            return Outcome(mounting.TEST, "skip", found)
        if not ask(mounting.REQUEST):
            return Outcome(mounting.TEST, "skip", "nobody stroked")
    played = replace(rig, backend=backend).listen(mounting.STROKES_S)
    return mounting.judge_strokes(played, backend.info.touch_latency_s)


def _to_do(error: HardwareError) -> str:
    if error.kind == "config":
        return "correct the configuration; end whatever else uses the device"
    return "see `frictus doctor`; check power and cables of the device"
