"""The publisher thread: packs what the loop hands over and puts it on the network."""

import contextlib
import gc
import queue
import threading
from collections.abc import Callable
from importlib.metadata import version
from typing import Final

import zenoh

from frictus.block import FingerSensor
from frictus.keys import STREAMS, RigKeys, Topics
from frictus.messages import (
    AuxChannel,
    Counters,
    Fault,
    LeaseEnd,
    LoopTiming,
    ModelState,
    RigStatus,
    SceneState,
    SensorName,
    TimeState,
)
from frictus.session import declare_latest_publisher, declare_publisher, is_read
from frictus_hardware.base import RigInfo
from frictus_service.daemon.block_loop.block_record import (
    BlockRecord,
    blocks_of,
    finger_of,
    flags_of,
    touch_of,
)
from frictus_service.daemon.block_loop.loop import HANDOVER_BLOCKS, BlockLoop
from frictus_service.daemon.block_loop.timebase import Timebase
from frictus_service.daemon.commands import Commands
from frictus_service.daemon.control import EndedLease, Interlock
from frictus_service.daemon.model_controller import ModelController
from frictus_service.daemon.safety import ACTIONS, FormerRun
from frictus_service.daemon.scene_controller import SceneController

STATUS_S: Final = 0.5
"""A status is published at least so often, and whenever the safety state changes."""
COLLECT_BLOCKS: Final = 2_000
"""The garbage collector runs after so many blocks; see `Publisher.run_until`."""
UNREAD_S: Final = 0.02
UNREAD_BLOCKS: Final = 4
"""Where nobody reads, what was handed over is taken every so often: waking this thread costs
more than what it does with a block, most of it the loop's time."""
SENSORS: Final[tuple[tuple[FingerSensor, SensorName], ...]] = (
    (FingerSensor.TOUCH, "touch"),
    (FingerSensor.ACCELERATION, "acceleration"),
    (FingerSensor.FORCE, "force"),
)
LATEST: Final = (Topics.STATUS, Topics.SCENE, Topics.MODEL, Topics.TIME)


class Publisher:
    """Publishes a rig's blocks and states.

    Parameters
    ----------
    session : zenoh.Session
        Outlives this.
    keys : RigKeys
        Keys of the rig.
    info : RigInfo
        What does not change while the rig is open.
    block_samples : int
        Samples of one block.
    force_limit_n : float
        Beyond which the loop trips.
    loop : BlockLoop
        Whose blocks are taken.
    interlock : Interlock
        Holds the safety state.
    stage : SceneController
        What is rendered.
    models : ModelController
        With which model.
    commands : Commands
        Knows what was refused, and who was not.
    monotonic_s, utc_ns : callable
        Clocks.
    say : callable
        Told what an operator should know.
    former : FormerRun or None
        How the run before ended, of a rig that was started again.
    """

    def __init__(
        self,
        session: zenoh.Session,
        keys: RigKeys,
        info: RigInfo,
        block_samples: int,
        force_limit_n: float,
        loop: BlockLoop,
        interlock: Interlock,
        stage: SceneController,
        models: ModelController,
        commands: Commands,
        monotonic_s: Callable[[], float],
        utc_ns: Callable[[], int],
        say: Callable[[str], None] = lambda _line: None,
        former: FormerRun | None = None,
    ) -> None:
        self._say = say
        self._lead_samples = loop.tally.lead_samples
        self._keys = keys
        self._info = info
        self._block_samples = block_samples
        self._force_limit_n = force_limit_n
        self._loop = loop
        self._interlock = interlock
        self._stage = stage
        self._models = models
        self._commands = commands
        self._monotonic_s = monotonic_s
        self._utc_ns = utc_ns
        self._streams = {
            stream: declare_publisher(session, keys.of(topic), topic)
            for stream, topic in STREAMS.items()
        }
        self._finger = declare_publisher(session, keys.of(Topics.FINGER), Topics.FINGER)
        self._touch = declare_publisher(session, keys.of(Topics.TOUCH), Topics.TOUCH)
        self._latest = {
            topic: declare_latest_publisher(session, keys.of(topic), topic) for topic in LATEST
        }
        self._timebase = Timebase(info.clock_hz)
        self._run = loop.run
        self._published = 0
        # Until it is known that nobody does.
        self._read_streams = tuple(self._streams)
        self._finger_read = self._touch_read = True
        self._unread_s = min(UNREAD_S, UNREAD_BLOCKS * block_samples / info.clock_hz)
        self._status_due_s = 0.0
        self._said: tuple[object, ...] = ()
        self._scene: SceneState | None = None
        self._model: ModelState | None = None
        self._fault = None if former is None else former.fault
        self._former_end = None if former is None else former.last_end
        self._ended: tuple[EndedLease, LeaseEnd] | None = None
        self._version = version("frictus")

    def run_until(self, stop: threading.Event) -> None:
        """Publish until told to stop and all that was handed over is out.

        The collector is off in a rig's process, since it may stop all threads for longer than
        a block when it meets everything that was ever imported; what exists before the loop
        starts is frozen. What the threads leave since is little: it is collected here, by the
        thread that can best wait, once in a while.
        """
        turns = 0
        while (taken := self._take(stop)) or not stop.is_set():
            self._publish(taken)
            turns += len(taken)
            if turns >= COLLECT_BLOCKS:
                gc.collect()
                turns = 0
            self._publish_states()
        self._put_status()

    def _take(self, stop: threading.Event) -> list[BlockRecord]:
        """Wait for what the loop hands over; where nobody reads, for several blocks."""
        if not self._loop.is_read:
            stop.wait(self._unread_s)
        taken: list[BlockRecord] = []
        with contextlib.suppress(queue.Empty):
            taken.append(self._loop.handover.get(timeout=0.1))
            while len(taken) < HANDOVER_BLOCKS:
                taken.append(self._loop.handover.get_nowait())
        return taken

    def _publish(self, turns: list[BlockRecord]) -> None:
        for turn in turns:
            self._put_block(turn)
        self._prepare_next()

    def _put_block(self, turn: BlockRecord) -> None:
        if turn.run != self._run:
            self._run = turn.run
            self._timebase = Timebase(self._info.clock_hz)
        exchange = turn.exchange
        end = exchange.first_sample + exchange.voltage_v.size
        self._timebase.observe(end, turn.returned_ns, turn.reading)
        if self._read_streams:
            flags = flags_of(turn, self._info, self._models.model.model.placeholder)
            stamp = self._timebase.stamp(exchange.first_sample)
            rate_hz = self._info.sample_rate_hz
            for block in blocks_of(turn, stamp, flags, rate_hz, self._read_streams):
                self._streams[block.stream].put(block.pack())
                self._published += 1
        if self._finger_read:
            finger = finger_of(turn, self._timebase.stamp(end), self._info)
            if finger is not None:
                self._finger.put(finger.to_json())
        if self._touch_read:
            for report in exchange.touches:
                state = touch_of(report, turn.run, self._info)
                if state is not None:
                    self._touch.put(state.to_json())

    def _prepare_next(self) -> None:
        """Do what readers of these turns need not wait for.

        The fit computes. Each question to Zenoh lets go of the interpreter's lock, which the
        loop then holds for longer than packing and putting a block takes.
        """
        self._timebase.fit()
        self._read_streams = tuple(
            stream for stream, publisher in self._streams.items() if is_read(publisher)
        )
        self._finger_read, self._touch_read = is_read(self._finger), is_read(self._touch)
        self._loop.is_read = bool(self._read_streams or self._finger_read or self._touch_read)

    def _publish_states(self) -> None:
        now_s = self._monotonic_s()
        # Before what it stands for is read: a state published at t includes what held at t.
        utc_ns = self._utc_ns()
        scene, model = self._stage.scene, self._models.model
        replaced = scene is not self._scene or model is not self._model
        said = (
            self._interlock.revision,
            self._stage.stream_open,
            self._stage.compensation,
            self._models.policy,
            self._models.adaptations,
            self._loop.rendering.stream_stale,
            self._loop.tally.finger_sensors,
            self._loop.tally.lead_samples,
            self._run,
            self._timebase.utc_steps,
        )
        if said == self._said and not replaced and now_s < self._status_due_s:
            return
        if replaced:
            stamp = {"utc_ns": utc_ns}
            self._latest[Topics.SCENE].put(scene.model_copy(update=stamp).to_json())
            self._latest[Topics.MODEL].put(model.model_copy(update=stamp).to_json())
            self._scene, self._model = scene, model
        self._said = said
        self._say_lead()
        self._status_due_s = now_s + STATUS_S
        self._put_status()
        self._put_time()

    def _say_lead(self) -> None:
        """Tell the operator of a lead that has grown."""
        before, lead = self._lead_samples, self._loop.tally.lead_samples
        if lead != before:
            self._lead_samples = lead
            self._say(
                f"the lead was too short for this machine: {self._ms(before):g} ms, "
                f"{self._ms(lead):g} from now on (underruns: {self._loop.tally.underruns}; "
                f"at most {self._ms(self._info.max_lead_samples):g}, max_lead_ms)"
            )

    def _ms(self, n_samples: int) -> float:
        return 1e3 * n_samples / self._info.sample_rate_hz

    def _put_time(self) -> None:
        timebase = self._timebase
        if not timebase.ready:
            return
        sample = timebase.newest_sample
        stamp = timebase.stamp(sample)
        state = TimeState(
            run=self._run,
            sample=sample,
            utc_ns=stamp.utc_ns,
            ns_per_sample=timebase.ns_per_sample,
            uncertainty_ns=stamp.uncertainty_ns,
            skew_ppm=timebase.skew_ppm,
            skew_uncertainty_ppm=timebase.skew_uncertainty_ppm,
            utc_steps=timebase.utc_steps,
        )
        self._latest[Topics.TIME].put(state.to_json())

    def _put_status(self) -> None:
        self._latest[Topics.STATUS].put(self.status().to_json())

    def status(self) -> RigStatus:
        """Return what the rig says of itself now."""
        utc_ns = self._utc_ns()  # first: what held at this time is in it
        # Before the safety state: a stream and a mode end with their arming, so that no status
        # says armed and names what is played after it.
        scene, stream_open = self._stage.scene, self._stage.stream_open
        compensation = self._stage.compensation
        info, safety, lateness = self._info, self._interlock.state, self._loop.lateness
        median_ms, high_ms = lateness.percentiles_ms()
        model, sensors = self._models.model, self._loop.tally.finger_sensors
        return RigStatus(
            site=self._keys.site,
            rig=self._keys.rig,
            version=self._version,
            run=self._run,
            utc_ns=utc_ns,
            state=safety.state,
            fault=self._fault_shown(),
            owner=safety.owner,
            share_with=safety.share_with,
            last_end=self._end_shown(),
            last_calls=self._commands.last_calls,
            backend=info.backend,
            simulated=info.simulated,
            finger_source=info.finger_source,
            finger_takeover=info.finger_takeover,
            finger_sensors=tuple(name for sensor, name in SENSORS if sensor in sensors),
            sample_rate_hz=info.sample_rate_hz,
            block_samples=self._block_samples,
            lead_ms=self._ms(self._loop.tally.lead_samples),
            max_lead_ms=self._ms(info.longest_lead_samples),
            screen_mm=info.screen_mm,
            screen_peak_v=info.screen_peak_v,
            force_limit_n=self._force_limit_n,
            converter_steps=dict(info.converter_steps),
            touch_latency_s=info.touch_latency_s,
            aux=tuple(AuxChannel(name=name, unit=unit) for name, unit in info.aux),
            model_etag=model.etag,
            model_placeholder=model.model.placeholder,
            scene_etag=scene.etag,
            compensation=compensation,
            adaptation=self._models.policy,
            adaptations=self._models.adaptations,
            stream_open=stream_open,
            stream_stale=self._loop.rendering.stream_stale,
            counters=self._counters(),
            timing=LoopTiming(
                lateness_p50_ms=median_ms,
                lateness_p99_ms=high_ms,
                lateness_max_ms=lateness.max_ms,
                margin_min_ms=lateness.least_margin_ms(),
            ),
        )

    def _fault_shown(self) -> Fault | None:
        fault = self._interlock.state.fault
        if fault is None:
            self._fault = None
        elif self._fault is None or fault != (self._fault.kind, self._fault.reason):
            kind, reason = fault
            self._fault = Fault(
                kind=kind, reason=reason, utc_ns=self._utc_ns(), action=ACTIONS[kind]
            )
            if self._interlock.state.state == "tripped":
                self._say(f"tripped, {kind}: {reason}. {self._fault.action}")
            elif self._interlock.state.lasting:
                self._say(f"{kind} fault: {reason}. {self._fault.action}")
        return self._fault

    def _end_shown(self) -> LeaseEnd | None:
        ended = self._interlock.ended
        if ended is None:
            return self._former_end
        if self._ended is None or self._ended[0] is not ended:
            shown = LeaseEnd(
                owner=ended.owner, by=ended.by, reason=ended.reason, utc_ns=self._utc_ns()
            )
            self._ended = ended, shown
        return self._ended[1]

    def _counters(self) -> Counters:
        tally, commands, stage = self._loop.tally, self._commands, self._stage
        return Counters(
            blocks=tally.blocks,
            deadline_misses=tally.deadline_misses,
            overruns=tally.overruns,
            underruns=tally.underruns,
            clipped_samples=tally.clipped_samples,
            extrapolated_samples=tally.extrapolated_samples,
            scaled_scenes=stage.scaled_scenes,
            stale_touches=tally.stale_touches,
            refused_commands=commands.refused,
            stream_updates=stage.updates,
            stream_updates_expired=commands.updates_expired + commands.updates_lost,
            blocks_published=self._published,
            blocks_dropped=tally.blocks_dropped,
            lead_growths=tally.lead_growths,
            trips=self._interlock.trips,
        )
