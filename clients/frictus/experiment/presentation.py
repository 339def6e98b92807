"""Intervals on the screen: faded in, held, faded out, at samples that recordings count too."""

import math
import time
from dataclasses import asdict, dataclass
from typing import Any, Final

from frictus.block import Block
from frictus.errors import FrictusError, LeaseLostError
from frictus.experiment.protocol import Presentation
from frictus.experiment.sensed import FingerPath, SensedForce
from frictus.experiment.stimuli import scaled
from frictus.experiment.tasks import Interval
from frictus.gaps import Gap
from frictus.keys import Topics
from frictus.lease import Lease
from frictus.messages import Applied, FingerState, SceneState
from frictus.rig import Rig
from frictus.textures import Region, Scene

FADE_STEP_S: Final = 0.025
"""A step of a fade; the rig cross-fades from one to the next."""
DRAIN_S: Final = 0.1
WHOLE: Final = 1.0 - 1e-9
SENSED_S: Final = 0.1
"""Longest wait for what was sensed at the end of an interval, beyond the lead."""
POLL_S: Final = 0.005
CAPACITY: Final = 4096
"""Finger states and blocks held while a call waits: 20 s."""


class ScaledError(FrictusError):
    """The rig would render a scene only in part.

    Parameters
    ----------
    gain : float
        What it would apply, below 1; also an attribute.
    """

    def __init__(self, gain: float) -> None:
        super().__init__(f"the rig would render {gain:.3g} of the scene")
        self.gain = gain


@dataclass(frozen=True, slots=True)
class PresentedInterval:
    """An interval as it was rendered.

    Attributes
    ----------
    shows : {'test', 'reference'}
        What was asked for.
    applied : Applied
        What the rig made of it; a gain below 1 scaled it.
    etag : str
        Of the scene.
    run, first_sample, last_sample : int
        Device samples at which it played, fades included; recordings count by the same.
    utc_ns : int
        UTC of the first sample.
    duration_s : float
        From first to last sample.
    finger : FingerPath or None
        How the finger moved; None where it did not touch.
    force : SensedForce or None
        What was measured; None where no samples came.
    """

    shows: Interval
    applied: Applied
    etag: str
    run: int
    first_sample: int
    last_sample: int
    utc_ns: int
    duration_s: float
    finger: FingerPath | None
    force: SensedForce | None

    @property
    def felt(self) -> bool:
        """Whether the finger touched and moved: friction is felt by one that slides."""
        return self.finger is not None and not self.finger.still

    def fields(self) -> dict[str, Any]:
        """Return it as a row of a log holds it."""
        return {**asdict(self), "applied": self.applied.model_dump()}


class Presenter:
    """Presents scenes on an armed rig; close it at the end.

    Parameters
    ----------
    rig : Rig
        The rig.
    lease : Lease
        Of this client; once it is lost, every method raises `LeaseLostError`.
    presentation : Presentation
        Durations, fades, mask, and what becomes of scenes that are scaled.
    """

    def __init__(self, rig: Rig, lease: Lease, presentation: Presentation) -> None:
        self._rig, self._lease, self._how = rig, lease, presentation
        self._fingers = rig.watch(Topics.FINGER, capacity=CAPACITY)
        self._blocks = rig.blocks("force", capacity=CAPACITY)
        self._states: list[FingerState] = []
        self._forces: list[Block | Gap] = []
        mask = presentation.mask
        self._between = Scene() if mask is None else Scene(regions=[Region(texture=mask)])
        self._ended_s: float | None = None  # since when the gap after an interval lasts

    def gap(self) -> None:
        """Have the finger feel what is felt between intervals, for the time of a gap."""
        self._rig.set_scene(self._between)
        begun_s = time.monotonic() if self._ended_s is None else self._ended_s
        self._wait(begun_s + self._how.gap_s)

    def require_lease(self) -> None:
        """Raise `LeaseLostError` if the rig no longer obeys."""
        if self._lease.lost:
            raise self._lease.loss or LeaseLostError("the lease is lost")

    def smooth(self) -> None:
        """Have the finger feel a smooth screen from now on."""
        self._ended_s = None
        self._rig.set_scene(Scene())

    def interval(self, shows: Interval, scene: Scene) -> PresentedInterval:
        """Present one interval.

        Parameters
        ----------
        shows : {'test', 'reference'}
            What it is.
        scene : Scene
            What is felt at its full height.

        Raises
        ------
        ScaledError
            If the rig would scale the scene and such trials are refused; then it was felt at
            most for a step of the fade.
        LeaseLostError
            If the rig no longer obeys.
        """
        self._collect()
        self._states, self._forces = [], []
        how = self._how
        steps = round(how.fade_s / FADE_STEP_S)
        begun_s, begun_ns = time.monotonic(), time.time_ns()
        first: SceneState | None = None
        for step in range(1, steps + 1):
            gain = math.sin(0.5 * math.pi * step / (steps + 1)) ** 2
            if first is None or time.monotonic() < begun_s + step * FADE_STEP_S:
                state = self._rig.set_scene(scaled(scene, gain))
                if first is None:  # a slow reply must not shorten the interval
                    first, begun_s = state, time.monotonic()
                self._refuse_scaled(min(1.0, state.applied.feasible_gain * gain))
            self._wait(begun_s + step * FADE_STEP_S)
        whole = self._rig.set_scene(scene)
        if first is None:
            begun_s = time.monotonic()
        self._refuse_scaled(whole.applied.gain)
        self._wait(begun_s + how.interval_s - steps * FADE_STEP_S)
        ending_s = time.monotonic()
        for step in range(steps, 0, -1):
            gain = math.sin(0.5 * math.pi * step / (steps + 1)) ** 2
            due_s = ending_s + (steps + 1 - step) * FADE_STEP_S
            if time.monotonic() < due_s:
                self._rig.set_scene(scaled(scene, gain))
            self._wait(due_s)
        last = self._rig.set_scene(self._between)
        self._ended_s = time.monotonic()
        return self._presented(shows, first or whole, whole, last, begun_ns)

    def close(self) -> None:
        """Stop receiving. Closing twice is harmless."""
        self._fingers.close()
        self._blocks.close()

    def _refuse_scaled(self, gain: float) -> None:
        if gain < WHOLE and self._how.on_scaled == "refuse":
            self._rig.set_scene(self._between)
            raise ScaledError(gain)

    def _wait(self, until_s: float) -> None:
        while True:
            self._collect()
            left_s = until_s - time.monotonic()
            self._lease.wait_lost(min(max(left_s, 0.0), DRAIN_S))
            self.require_lease()
            if left_s <= DRAIN_S:
                return

    def _await_sensed(self, end: int, lead_s: float) -> None:
        """Wait until the end of an interval is sensed, a lead after it was asked for."""
        due_s = time.monotonic() + lead_s + SENSED_S
        self._collect()
        while time.monotonic() < due_s:
            blocks = [item for item in self._forces[-1:] if isinstance(item, Block)]
            newest = [state.sample for state in self._states[-1:]]
            newest += [block.first_sample for block in blocks]
            if len(newest) == 2 and min(newest) >= end:
                return
            self._wait(time.monotonic() + POLL_S)

    def _collect(self) -> None:
        states = self._fingers.drain()
        self._states += [state for state in states if isinstance(state, FingerState)]
        self._forces += self._blocks.drain()

    def _presented(
        self,
        shows: Interval,
        first: SceneState,
        whole: SceneState,
        last: SceneState,
        begun_ns: int,
    ) -> PresentedInterval:
        """Return the interval between two scenes, by the samples at which they played."""
        fit, lead_s = self._rig.time(), 1e-3 * self._rig.status().lead_ms
        lead = lead_s * 1e9 / fit.ns_per_sample
        begin, end = (
            fit.sample + round((utc_ns - fit.utc_ns) / fit.ns_per_sample + lead)
            for utc_ns in (first.utc_ns or begun_ns, last.utc_ns or time.time_ns())
        )
        self._await_sensed(end, lead_s)
        states = [state for state in self._states if begin <= state.sample < end]
        forces = [
            item
            for item in self._forces
            if isinstance(item, Gap) or begin <= item.first_sample < end
        ]
        return PresentedInterval(
            shows,
            whole.applied,
            whole.etag,
            fit.run,
            begin,
            end,
            fit.utc_of(begin),
            (end - begin) * 1e-9 * fit.ns_per_sample,
            FingerPath.of(states),
            SensedForce.of(forces),
        )
