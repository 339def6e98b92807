"""One session of a finger on the twin whose model follows it: what is rendered depends on it.

In pieces of a tenth of a second the renderer plays a texture by the model in force, the twin
feels it, the tracker learns from it, and the policy says whether what was learned is put in
force; what is rendered from then on is rendered by it. The states of renderer, twin and tracker
go on from piece to piece, so that nothing restarts at their edges.
"""

import re
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from frictus.aligned import AlignedSamples
from frictus.block import Flag
from frictus.messages import TouchState
from frictus_hardware.arrays import FloatArray
from frictus_hardware.physics.compiled import compiled
from frictus_hardware.physics.linear import Mount
from frictus_hardware.physics.screen import Screen
from frictus_hardware.physics.simulator import Simulator
from frictus_hardware.physics.stages import Quantisation, SensorNoise
from frictus_hardware.physics.twin import Signals, States, Twin
from frictus_laboratory.live_model.disturbances import SessionSpan
from frictus_laboratory.live_model.laws import error_db, law_of, values_of
from frictus_laboratory.live_model.motion import (
    Motion,
    MotionPiece,
    rendered_rows,
)
from frictus_laboratory.live_model.session_plan import SessionPlan, config_of, motion_of
from frictus_service.calibration import coordinates
from frictus_service.calibration.coordinates import Prior
from frictus_service.fidelity.measure import full_gain
from frictus_service.fidelity.path import BLOCK_SAMPLES
from frictus_service.synthesis.compensation import as_inverse
from frictus_service.synthesis.estimator import PredictedMotion
from frictus_service.synthesis.renderer import Renderer
from frictus_service.tracking.model_in_force import ModelInForce
from frictus_service.tracking.policy import Circumstances, concluded
from frictus_service.tracking.touch_motion import TouchedSamples
from frictus_service.tracking.tracker import Tracker
from frictus_service.tracking.windows import WindowCutter

PIECE_SAMPLES: Final = 2_000
"""A tenth of a second: a change of model is played so much after it was decided, at most."""


@dataclass(frozen=True, slots=True)
class Moment:
    """How a session stands after one piece; errors are of renderings that undo a model.

    Attributes
    ----------
    at_s : float
        Since the session began.
    in_force_db, newest_db, first_db : float
        Error of the model in force, of the newest estimate, and of the model at the beginning,
        against the true law of this moment; dB rms over third octaves at 20 to 100 mm/s.
    changed : bool
        Whether the model in force became another.
    updated : bool
        Whether the estimate did.
    """

    at_s: float
    in_force_db: float
    newest_db: float
    first_db: float
    changed: bool
    updated: bool


class ClosedLoop:
    """A session; iterate over it for its `Moment`s.

    Parameters
    ----------
    plan : SessionPlan
        What it is made of.
    motion : Motion, optional
        Of the finger, where two sessions share one; made from the plan if not given.
    keep : callable, optional
        Given what the tracker is given, piece by piece.

    Attributes
    ----------
    tracker : Tracker
        What is known of the finger.
    true : ndarray, shape (4,)
        The true law of the last moment in `calibration.coordinates`.
    in_force : ndarray, shape (4,)
        The model in force.
    named : dict of str to float
        Causes with an alarm, and when it first rose, s.
    held : Counter of str
        Why the model in force stayed, by how many updates.
    changes, new_fingers : list of float
        When it became another, and when the estimate began anew, s.
    arithmetic_s : float
        Processor time of tracker and policy so far.
    """

    def __init__(
        self,
        plan: SessionPlan,
        motion: Motion | None = None,
        keep: Callable[[AlignedSamples], None] = lambda part: None,
    ) -> None:
        self._plan = plan
        self._keep = keep
        self._config = config_of(plan)
        self._motion = motion or motion_of(plan)
        self._rate_hz = self._config.sample_rate_hz
        self._prior = Prior.weak()
        mount = Mount().lateral
        cutter = WindowCutter(self._rate_hz, self.screen.peak_v, mount)
        self.tracker = Tracker(cutter, self._prior)
        self._afterwards = TouchedSamples()
        self._model = plan.first
        self._put_in_force("first")
        law = law_of(plan.first)
        scene = full_gain(plan.texture, law, self.screen, self._rate_hz)
        self._renderer = Renderer(law, self.screen, self._rate_hz, BLOCK_SAMPLES, scene)
        self._twin_key: tuple[Simulator, float] | None = None
        self._twin = Twin(())
        self._states: States = ()
        self._span = SessionSpan(0.0, 0, 0, 60.0, 0.4)
        self._direction = self._touched = 0.0
        self.true = coordinates.from_law(*values_of(plan.person.law), 0.0)
        self.named: dict[str, float] = {}
        self.held: Counter[str] = Counter()
        self.changes: list[float] = []
        self.new_fingers: list[float] = []
        self.arithmetic_s = 0.0

    @property
    def screen(self) -> Screen:
        """That is touched."""
        return self._config.screen

    def __iter__(self) -> Iterator[Moment]:
        """Yield the moment after each piece."""
        plan = self._plan
        first = self.in_force
        for sample in range(0, round(plan.seconds * self._rate_hz), PIECE_SAMPLES):
            piece = self._motion.piece(sample, PIECE_SAMPLES)
            self._note_span(sample, piece)
            courses = tuple(
                None if each is None else plan.disturbance.predicted(each, self._span)
                for each in piece.courses
            )
            voltage = self._play(sample, piece, courses)
            signals = self._feel(piece, voltage)
            part = AlignedSamples(
                run=1,
                first_sample=sample,
                utc_ns=round(1e9 * sample / self._rate_hz),
                sample_rate_hz=self._rate_hz,
                missing_samples=0,
                flags=Flag(0),
                data={
                    "force": signals.force_n.T.astype(np.float32),
                    "voltage": signals.voltage_v[np.newaxis].astype(np.float32),
                    "render": rendered_rows(courses, self._rate_hz).astype(np.float32),
                },
            )
            end_s = (sample + PIECE_SAMPLES) / self._rate_hz
            sensed = plan.disturbance.sensed(part, self._span)
            self._keep(sensed)
            updated, changed = self._learn(tuple(self._moved(sensed, piece)), end_s)
            yield Moment(
                end_s,
                error_db(self.in_force, self.true),
                error_db(self.tracker.estimate.mean, self.true),
                error_db(first, self.true),
                changed,
                updated,
            )

    def _moved(self, part: AlignedSamples, piece: MotionPiece) -> Iterator[AlignedSamples]:
        """Yield samples with the motion that the tracker takes the finger for."""
        if piece.touches is None:
            yield part
            return
        for report in piece.touches:
            seen = self._plan.disturbance.touched(report, self._span)
            self._afterwards.report(
                TouchState(
                    run=part.run,
                    sample=seen.measured_sample,
                    x_mm=seen.x_mm,
                    y_mm=seen.y_mm,
                    in_contact=seen.in_contact,
                    source="simulated",
                )
            )
        yield from self._afterwards.take(part)

    def _note_span(self, sample: int, piece: MotionPiece) -> None:
        """Count contacts and strokes, on which what varies within a person hangs."""
        touched = float(piece.in_contact[0])
        direction = float(np.sign(piece.velocity_mm_s[:, 0].mean()))
        before = self._span
        self._span = SessionSpan(
            sample / self._rate_hz,
            before.contact + (touched > self._touched),
            before.stroke + (direction != self._direction),
            float(np.hypot(*piece.velocity_mm_s.T).mean()),
            float(piece.normal_force_n.mean()),
        )
        self._touched, self._direction = touched, direction

    def _play(
        self, sample: int, piece: MotionPiece, courses: tuple[PredictedMotion | None, ...]
    ) -> FloatArray:
        voltage = np.zeros(PIECE_SAMPLES)
        for block, course in enumerate(courses):
            if course is None:
                continue
            cut = slice(BLOCK_SAMPLES * block, BLOCK_SAMPLES * (block + 1))
            touches = bool(piece.in_contact[cut.start])
            rendered = self._renderer.render(
                sample + cut.start, course, allow=touches, lifted=not touches
            )
            voltage[cut] = rendered.voltage_v
        return voltage

    def _feel(self, piece: MotionPiece, voltage_v: FloatArray) -> Signals:
        plan, span = self._plan, self._span
        person = plan.disturbance.person(plan.person, span)
        simulator = plan.disturbance.simulator(person, span)
        # To a twin the session's time stands still; its states outlast it.
        minutes = int(span.at_s) / 60.0 if simulator.schedule != Simulator().schedule else 0.0
        if self._twin_key != (simulator, minutes):
            self._twin_key = simulator, minutes
            # The accelerometer is not read: its noise, drawn apart, would cost for nothing.
            noise = SensorNoise(self._config.force_noise_n, 0.0, plan.seed)
            self._twin = compiled(
                simulator.twin(
                    self.screen,
                    person.friction_coefficient,
                    (noise, Quantisation()),
                    minutes=minutes,
                    seed=plan.seed,
                )
            )
            begun = self._twin.initial()
            if list(map(type, begun)) != list(map(type, self._states)):  # of other stages
                self._states = begun
        # What is to be undone at the speed that the rig takes for the finger's.
        gain, cutoff, slope = values_of(person.law)
        slope /= plan.disturbance.speed_scale(span)
        self.true = coordinates.from_law(gain, cutoff, slope, simulator.delay_s)
        signals = Signals.driven(
            self._rate_hz,
            voltage_v,
            piece.position_mm,
            piece.velocity_mm_s,
            piece.normal_force_n,
            piece.in_contact,
        )
        signals, self._states = self._twin.run(signals, self._states)
        return signals

    def _learn(self, parts: Sequence[AlignedSamples], end_s: float) -> tuple[bool, bool]:
        """Return whether the estimate became another, and whether the model in force did."""
        began = time.process_time()
        updated = any([self.tracker.take(part) for part in parts])
        if updated:
            for alarm in self.tracker.alarms:
                self.named.setdefault(alarm.cause, end_s)
        if self.tracker.new_fingers > len(self.new_fingers):
            self.new_fingers.append(end_s)
        asked = self._plan.policy == "adapt" and (
            updated or self.tracker.lifted or self.tracker.doubted
        )
        changed = asked and self._adapt(end_s)
        self.arithmetic_s += time.process_time() - began
        if changed:
            self._render_anew()
        return updated, changed

    def _adapt(self, end_s: float) -> bool:
        now = Circumstances(
            since_change_s=end_s - self.changes[-1] if self.changes else np.inf,
            adapted=self._model is not self._plan.first,
        )
        found = concluded(self.tracker, self._model, self._plan.first, self._prior, now)
        if found.model is None:
            self.held[_kind_of(found.held_back)] += 1
            return False
        self._model = found.model
        self.changes.append(end_s)
        self._put_in_force(f"change {len(self.changes)}")
        return True

    def _put_in_force(self, etag: str) -> None:
        model = ModelInForce.of(etag, self._model)
        assert model.at is not None
        self.in_force = model.at
        self.tracker.put_in_force(model)

    def _render_anew(self) -> None:
        law = law_of(self._model)
        scene = full_gain(self._plan.texture, law, self.screen, self._rate_hz)
        self._renderer.set_scene(scene)
        self._renderer.set_inverse(as_inverse(law))


def _kind_of(reason: str) -> str:
    """Return a reason without its numbers, so that equal ones are counted together."""
    return re.sub(r"\d+(\.\d+)?", "…", reason)
