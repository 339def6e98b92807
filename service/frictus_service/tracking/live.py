"""The finger on a rig, live: reads its streams, tells the estimate, asks for a change of model.

A plain reader of the rig but for one call: under the policy `adapt`, which the rig holds and
judges, it asks for the model to follow the finger. If it lags, dies or stands still, the rig
goes on with the model that it has.
"""

import time
from collections import deque
from collections.abc import Callable, Iterator
from functools import partial
from types import TracebackType
from typing import Final, Self

import frictus
from frictus.aligned import AlignedSamples
from frictus.block import Block
from frictus.errors import FrictusError, LinkError, SilenceError
from frictus.gaps import BlockFeed, Gap
from frictus.keys import CHANNELS, FORCE, VOLTAGE, Topics
from frictus.messages import (
    MAX_CHANGES,
    GuidanceState,
    Message,
    ModelChange,
    ModelState,
    RigStatus,
    SceneState,
    TouchState,
)
from frictus.model import Model
from frictus.rig import Rig
from frictus_hardware.physics.linear import TransferFunction
from frictus_service.calibration.coordinates import Prior
from frictus_service.recording.samples import Coalescer
from frictus_service.tracking.adaptation import law_values
from frictus_service.tracking.audit import ModelChangeLog
from frictus_service.tracking.carried import carried
from frictus_service.tracking.model_history import ModelHistory, ModelStep
from frictus_service.tracking.model_in_force import ModelInForce
from frictus_service.tracking.policy import Circumstances, concluded
from frictus_service.tracking.touch_motion import TouchedSamples
from frictus_service.tracking.tracker import STATE_S, Tell, Tracker
from frictus_service.tracking.windows import WindowCutter

SILENT_S: Final = 3.0
BEAT_S: Final = 0.25
"""What has come is taken this often: a block at a time costs four times as much."""
ROWS: Final = {"force": len(CHANNELS[FORCE]), "voltage": len(CHANNELS[VOLTAGE])}
PUT_BACK: Final = "put back as it was set"
GUIDED: Final = ("approach", "record")
"""Phases of a guided trial."""


class LiveTracker:
    """Follows the finger on one rig; a context manager.

    Parameters
    ----------
    rig : Rig
        Of a client.
    mount : TransferFunction or None
        Between screen and force sensor, lateral, force to force.
    population : Prior
        Of a person of whom nothing is known.
    tell : callable
        Told the estimate twice a second.
    audit : ModelChangeLog or None
        Takes each change of the model.
    monotonic_s : callable
        Monotonic clock, s.

    Attributes
    ----------
    tracker : Tracker
        With the newest estimate.
    status : RigStatus
        The newest.
    """

    def __init__(
        self,
        rig: Rig,
        mount: TransferFunction | None,
        population: Prior,
        tell: Tell,
        audit: ModelChangeLog | None = None,
        monotonic_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._rig = rig
        self._population = population
        self._tell = tell
        self._audit = audit
        self._monotonic_s = monotonic_s
        self.status: RigStatus = rig.status()
        self._place = f"{self.status.site}/{self.status.rig}"
        self._rate_hz = self.status.sample_rate_hz
        cutter = WindowCutter(self._rate_hz, self.status.screen_peak_v, mount)
        self.tracker = Tracker(cutter, population, self._place)
        self._states = [
            rig.watch(topic)
            for topic in (
                *(Topics.STATUS, Topics.MODEL, Topics.SCENE, Topics.GUIDANCE),
                Topics.TOUCH,
            )
        ]
        self._touched = TouchedSamples()
        self._models = ModelHistory()
        self._scene: SceneState | None = None
        self._guided_s = self._changed_s = self._felt_s = -float("inf")
        self._changes: deque[ModelChange] = deque(maxlen=MAX_CHANGES)
        self._unwritten: deque[Callable[[], None]] = deque()
        self._unaudited = ""

    def __enter__(self) -> Self:
        """Return self."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Stop listening."""
        for feed in self._states:
            feed.close()

    def follow(self, over: Callable[[], bool]) -> None:
        """Follow the finger until it is over.

        Parameters
        ----------
        over : callable
            Asked four times a second; true ends it.

        Raises
        ------
        SilenceError
            If the rig says nothing for 3 s.
        LinkError
            If the router is gone.
        """
        told_s = -float("inf")
        with (
            self._rig.blocks("force") as force,
            self._rig.blocks("voltage") as voltage,
        ):
            for part in frictus.align(
                force=self._joined(force, over), voltage=self._joined(voltage, over)
            ):
                self._hear()
                if not self._is_of_the_rig(part):
                    self.tracker.leave_out("blocks of another rate or other channels")
                    continue
                for moved in self._touched.take(part):
                    if self.tracker.take(moved):
                        self._felt_s = self._monotonic_s()
                if self._monotonic_s() - told_s >= STATE_S:
                    told_s = self._monotonic_s()
                    self._conclude()
                if over():
                    return

    def _is_of_the_rig(self, part: AlignedSamples) -> bool:
        """Return whether samples are such as the rig's: others may put under its keys, too."""
        rows = {name: data.shape[0] for name, data in part.data.items()}
        return part.sample_rate_hz == self._rate_hz and rows == ROWS

    def _joined(self, feed: BlockFeed, over: Callable[[], bool]) -> Iterator[Block]:
        """Yield what a stream brings, a quarter of a second at a time."""
        joined = Coalescer()
        heard_s = due_s = self._monotonic_s()
        while not over():
            blocks = [item for item in feed.drain() if not isinstance(item, Gap)]
            for block in blocks:
                for samples in joined.add(block):
                    yield samples.block()
            for samples in joined.flush():
                yield samples.block()
            now_s = self._monotonic_s()
            if blocks:
                heard_s = now_s
                due_s = max(due_s + BEAT_S, now_s)
            elif now_s - heard_s > SILENT_S:
                raise SilenceError(f"rig {self._rig.name} has said nothing for {SILENT_S:g} s")
            else:
                due_s = now_s + 0.1 * BEAT_S
            time.sleep(due_s - now_s)

    def _hear(self) -> None:
        """Take note of what else the rig has said."""
        for feed in self._states:
            for message in feed.drain():
                self._note(message)

    def _note(self, message: Message) -> None:
        match message:
            case RigStatus():
                self.status = message
            case TouchState():
                self._touched.report(message)
            case SceneState():
                self._scene = message
            case GuidanceState():
                if message.phase in GUIDED:
                    self._guided_s = self._monotonic_s()
            case ModelState():
                self._note_model(message)

    def _note_model(self, new: ModelState) -> None:
        """Take note of the model in force; one that was set is of another person, perhaps."""
        old, step = self._models.newest, self._models.add(new)
        if step is ModelStep.SAME:
            return
        self._changed_s = self._monotonic_s()
        if old is None or step is ModelStep.SET:
            prior = Prior.of_person(new.model, self._population)
            self.tracker.begin_anew(prior, new.model.participant)
        elif (change := _change(old, new)) is not None:
            self._changes.append(change)
            self._keep(change, old.model, new.model)
        self.tracker.put_in_force(ModelInForce.of(new.etag, carried(new.model, self._place)))

    def _keep(self, change: ModelChange, before: Model, after: Model) -> None:
        if self._audit is not None:
            add = partial(self._audit.add, self.status, change, before, after)
            self._unwritten.append(add)
            self._write_down()

    def _write_down(self) -> None:
        """Write down what is not yet: a disk that was full may take it now."""
        try:
            while self._unwritten:
                self._unwritten[0]()
                self._unwritten.popleft()
            self._unaudited = ""
        except OSError as error:
            self._unaudited = f"changes of the model cannot be written down: {error}"

    def _conclude(self) -> None:
        """Have the model follow the finger where it may, and tell what is known."""
        self._write_down()
        state = self.tracker.state(time.time_ns())
        why = self._unaudited or self._follow()
        self._tell(
            state.model_copy(
                update={
                    "policy": self.status.adaptation,
                    "held_back": why,
                    "changes": tuple(self._changes),
                }
            )
        )

    def _follow(self) -> str:
        """Ask for the model that is to be in force; return why the estimate is not."""
        model, as_set = self._models.newest, self._models.as_set
        if model is None:
            return "the rig has not said yet which model it renders by"
        found = concluded(
            self.tracker,
            model.model,
            as_set.model if as_set else None,
            self._population,
            self._circumstances(model),
        )
        if self.status.adaptation != "adapt" or found.model is None:
            return found.held_back
        try:
            self._rig.adapt(found.model, model.etag, found.reason)
        except LinkError as error:
            return f"the rig did not answer: {error}"
        except FrictusError as error:
            return f"the rig refused: {error}"
        self._changed_s = self._monotonic_s()
        return ""

    def _circumstances(self, model: ModelState) -> Circumstances:
        now_s = self._monotonic_s()
        as_set = self._models.as_set
        is_as_set = as_set is not None and model.etag == as_set.etag
        return Circumstances(
            source=self._scene.source if self._scene else "scene",
            compensated=self.status.compensation.mode == "model",
            guided=now_s - self._guided_s < 1.0,
            since_change_s=now_s - self._changed_s,
            since_felt_s=now_s - self._felt_s,
            adapted=model.adapted_from is not None and not is_as_set,
        )


def _change(old: ModelState, new: ModelState) -> ModelChange | None:
    """Return how a model became another; None where either is not a law alone."""
    before, after = law_values(old.model), law_values(new.model)
    if before is None or after is None:
        return None
    return ModelChange(
        utc_ns=new.utc_ns or time.time_ns(),
        etag_before=old.etag,
        etag_after=new.etag,
        before=before,
        after=after,
        reason=new.reason or PUT_BACK,
    )
