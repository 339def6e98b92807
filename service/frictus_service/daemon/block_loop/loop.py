"""The block loop: exchange, estimate, render, hand over. Nothing in it waits for anyone.

It calls no Zenoh, writes no log and lets nothing grow. Other threads leave updates for it in
slots of one, where the newest wins, and take finished blocks from a bounded queue; what does
not fit is dropped and counted.
"""

import threading
import time
from collections.abc import Callable
from queue import SimpleQueue
from typing import Final

import numpy as np

from frictus.messages import FaultKind
from frictus_hardware.base import Backend, GrowingLead
from frictus_hardware.errors import (
    DeviceLostError,
    HardwareError,
    LinkLostError,
    StreamLostError,
    UnderrunError,
)
from frictus_service.config import Config
from frictus_service.daemon.block_loop.block_checks import (
    BlockChecks,
    Lateness,
    LoopCounters,
    OutputFlags,
)
from frictus_service.daemon.block_loop.block_record import BlockRecord
from frictus_service.daemon.block_loop.lead import LeadGrowth
from frictus_service.daemon.block_loop.rendering import LoopRendering
from frictus_service.daemon.block_loop.timebase import UtcReading
from frictus_service.daemon.control import Interlock
from frictus_service.daemon.inboxes import LoopInbox
from frictus_service.daemon.safety import Event, FaultCleared, FaultRaised, OutputQuiet, Safety
from frictus_service.processes import Heartbeat
from frictus_service.synthesis.chain import RenderedBlock
from frictus_service.synthesis.renderer import RAMP_S

HANDOVER_BLOCKS: Final = 64
"""Blocks that the publisher may lag behind: 320 ms."""
REOPEN_S: Final = 1.0
"""Between tries to open a device that was lost."""
HEALTH_BLOCKS: Final = 100
"""The device's own health is asked for every so many blocks."""
PAUSE_S: Final = 0.002
GIVE_WAY: Final = 0.1
"""Share of a block for which the loop sleeps once it has handed one over that is read. Else the
publisher gets the interpreter, and Zenoh's threads a core, only after the next block has been
rendered; there is time enough for that in the rest of the block. With 0.05 blocks came 0.2 ms
later in most runs: Zenoh's threads were still at work when the loop took their core."""
LOST: Final = ("stream_lost", "device_lost", "link_lost")


class BlockLoop:
    """Runs a rig, block by block.

    Parameters
    ----------
    backend : Backend
        Open.
    config : Config
        Of the service.
    interlock : Interlock
        Holds the safety state.
    inbox : LoopInbox
        With the model to begin with.
    heartbeat : Heartbeat
        Counts the turns.
    run : int
        Number of the first run.
    monotonic_ns, utc_ns : callable
        Clocks, ns.
    sleep : callable
        Sleeps for at least so many seconds.

    Attributes
    ----------
    rendering : LoopRendering
        The chain, and what it renders.
    is_read : bool
        Whether somebody waits for what is handed over. Written by the publisher.
    """

    def __init__(
        self,
        backend: Backend,
        config: Config,
        interlock: Interlock,
        inbox: LoopInbox,
        heartbeat: Heartbeat,
        run: int,
        monotonic_ns: Callable[[], int],
        utc_ns: Callable[[], int],
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._backend = backend
        self._interlock = interlock
        self._heartbeat = heartbeat
        self._missed_limit = config.limits.missed_deadlines
        self._monotonic_ns = monotonic_ns
        self._utc_ns = utc_ns
        self._sleep = sleep
        self._give_way_s = GIVE_WAY * config.block_samples / backend.info.clock_hz
        self.is_read = True
        self._checks = BlockChecks(backend, config.limits, self._feed)
        info = backend.info
        self._output_flags = OutputFlags(info.longest_lead_samples, config.block_samples)
        self._lead_growth = LeadGrowth(config.block_samples)
        self.run = run
        self._number = 0
        self._energised = False
        self._arming = self._zero_from = 0
        self._parked: FaultKind | None = None
        self._broken = False
        self._was_stale = True
        self.rendering = LoopRendering(backend, config, interlock, inbox, self._now_s)
        self.tally = LoopCounters(lead_samples=info.lead_samples)
        self.lateness = Lateness(backend.info.clock_hz)
        self.handover: SimpleQueue[BlockRecord] = SimpleQueue()

    def begin_anew(self) -> None:
        """Close the device and open it again; one that is lost meanwhile is waited for."""
        self._let_go()
        try:
            self._backend.open()
        except (StreamLostError, DeviceLostError, LinkLostError) as error:
            self._on_fault(error)

    def run_until(self, stop: threading.Event) -> None:
        """Turn until told to stop; then ramp the output to zero and play the ramp out."""
        while not stop.is_set():
            if not self.turn():
                stop.wait(PAUSE_S)  # nothing was waited for, and a fault must not busy the CPU
            elif self.is_read:
                self._sleep(self._give_way_s)
            if self.parked:
                self.wait_for_device(stop)
        self._wind_down()

    @property
    def parked(self) -> bool:
        """Whether the device is lost and has to be opened anew."""
        return self._parked is not None

    # A sensor's absurd number may become infinite, and infinite trips: that is no warning.
    @np.errstate(over="ignore")
    def turn(self) -> bool:
        """Do one block and return whether it was done; what goes wrong becomes a fault."""
        beats = self._heartbeat.value
        self._heartbeat.value = beats + 1
        if self._parked is not None:
            self._interlock.tick(self._now_s())
            return False
        try:
            now_s = self._now_s()
            safety = self._interlock.tick(now_s)
            self._follow(safety)
            self.rendering.update(safety, now_s, self._energised)
            step = self.rendering.chain.step(self._energised and safety.may_render(now_s))
            returned_ns = self._monotonic_ns()
            reading = UtcReading(returned_ns, self._utc_ns(), self._monotonic_ns())
            self._output_flags.note(step, self.rendering.chain.renderer.scene.applied.scaled)
            self._hand_over(step, returned_ns, reading)  # early: readers wait for it
            self._checks.check(step.exchange, self._zero_from)
            self._account(step, returned_ns)
            if self._number % HEALTH_BLOCKS == 0:
                self._checks.check_health()
            return True
        except HardwareError as error:
            self._on_fault(error)
        except Exception as error:
            self._on_bug(error)
        return False

    def _now_s(self) -> float:
        return 1e-9 * self._monotonic_ns()

    def _feed(self, event: Event) -> None:
        self._interlock.feed(event, self._now_s())

    def _follow(self, safety: Safety) -> None:
        """Make the device what the safety state says."""
        if self._energised:
            if not safety.energised or safety.armings != self._arming:
                self._halt()
        elif self._sensed_end() >= self._zero_from:  # the last ramp has been played out
            if safety.energised:
                self._lengthen_lead()
                self.lateness.restart()  # else a clock that once stood still trips for ever
                self._backend.arm()
                self._energised, self._arming = True, safety.armings
            elif safety.state == "stopping":
                self._feed(OutputQuiet())

    def _lengthen_lead(self) -> None:
        """Make the lead longer if samples were missing since the last arming; nothing plays."""
        backend, info = self._backend, self._backend.info
        lead = self._lead_growth.wanted(info.lead_samples, info.max_lead_samples)
        more = lead - info.lead_samples
        if more and isinstance(backend, GrowingLead):
            self._checks.note_zeros(backend.next_play_sample, more)
            backend.lengthen_lead(lead)
            self.lateness.forget_blocks()
            self.tally.lead_samples = lead
            self.tally.lead_growths += 1
        self._lead_growth.forget()

    def _sensed_end(self) -> int:
        return self._backend.next_play_sample - self._backend.info.lead_samples

    def _halt(self) -> None:
        self._energised = False
        self._zero_from = self._backend.next_play_sample
        try:
            self._backend.stop(RAMP_S)
        finally:
            self.rendering.end_arming()  # and with it what a client streamed

    def _account(self, step: RenderedBlock, returned_ns: int) -> None:
        exchange, tally = step.exchange, self.tally
        n = exchange.voltage_v.size
        late_in_a_row = self.lateness.note(
            returned_ns, exchange.first_sample + n, n, exchange.margin_samples
        )
        tally.blocks += 1
        tally.deadline_misses += late_in_a_row > 0
        tally.overruns += exchange.overrun_samples > 0
        tally.underruns += exchange.underrun_samples > 0
        if self._energised:  # what the device lost before it was sensed, no lead holds out
            run_dry = exchange.underrun_samples - exchange.overrun_samples
            self._lead_growth.note(max(run_dry, 0))
        tally.clipped_samples += step.rendered.clipped_samples + exchange.clipped_samples
        tally.extrapolated_samples += step.rendered.extrapolated_samples
        tally.stale_touches += step.stale and not self._was_stale
        self._was_stale = step.stale
        self._broken = False
        if late_in_a_row >= self._missed_limit and self._energised:
            late_ms = 1e3 * n * late_in_a_row / self._backend.info.clock_hz
            self._feed(
                FaultRaised(
                    "deadline", f"{late_in_a_row} blocks in a row ({late_ms:.0f} ms) late"
                )
            )

    def _hand_over(self, step: RenderedBlock, returned_ns: int, reading: UtcReading) -> None:
        number = self._number
        self._number += 1
        if self.handover.qsize() >= HANDOVER_BLOCKS:
            self.tally.blocks_dropped += 1
            return
        exchange = step.exchange
        end = exchange.first_sample + exchange.voltage_v.size
        estimator = self.rendering.estimator
        self.tally.finger_sensors = sensors = estimator.sensors(end)
        (x, vx), (y, vy) = estimator.estimate(end).tolist()
        turn = BlockRecord(
            self.run,
            number,
            exchange,
            step.in_contact,
            step.stale,
            step.normal_force_n,
            self._energised,
            self._output_flags.over(exchange.first_sample, exchange.voltage_v.size),
            self._output_flags.over(exchange.play_sample, exchange.voltage_v.size),
            step.motion,
            step.rendered.target_n.copy(),
            step.rendered.drive.copy(),
            sensors,
            (x, y, vx, vy),
            estimator.report_age_s(end),
            returned_ns,
            reading,
        )
        self.handover.put(turn)

    def _on_fault(self, error: HardwareError) -> None:
        kind: FaultKind = error.kind  # type: ignore[assignment]
        if isinstance(error, UnderrunError):
            self.tally.underruns += 1
            if self._energised:
                self._lead_growth.note_run_dry()
        if kind in LOST:
            self._parked = kind
            self._feed(FaultRaised(kind, str(error)))
        elif kind == "sensor":
            self._checks.sensor_lost = True
            self._feed(FaultRaised(kind, str(error)))
        elif kind == "safety":
            self._feed(FaultRaised(kind, str(error)))
        else:
            self._on_bug(error)

    def _on_bug(self, error: Exception) -> None:
        """Trip, and go on with a fresh chain; a second one in a row ends the process."""
        self._feed(FaultRaised("internal", f"{type(error).__name__}: {error}"))
        if self._broken:
            raise error
        self._broken = True
        self._energised = False
        self._zero_from = self._backend.next_play_sample
        try:
            self._backend.stop(RAMP_S)
        except HardwareError as gone:
            self._on_fault(gone)
        self.rendering.begin_anew()

    def wait_for_device(self, stop: threading.Event) -> None:
        """Close the device and open it again; beats 0 meanwhile: opening may take long."""
        kind = self._parked
        assert kind is not None
        beats = self._heartbeat.value
        self._heartbeat.value = 0
        self._energised = False
        try:
            self._let_go()
            while not stop.wait(REOPEN_S):
                self._interlock.tick(self._now_s())
                if self._reopened():
                    self._parked = None
                    self._feed(FaultCleared(kind))
                    break
        finally:
            self._heartbeat.value = beats

    def _let_go(self) -> None:
        try:
            self._backend.close()
        except HardwareError as error:  # the output could not be brought to zero
            self._feed(FaultRaised("safety", str(error)))

    def _reopened(self) -> bool:
        try:
            self._backend.open()
        except HardwareError:
            return False  # the fault that is shown already says so; tried again in a while
        self.run += 1
        self._number = 0
        self._zero_from = 0
        self.lateness.restart()
        self._checks.restart()
        self._output_flags.restart()
        self.rendering.begin_anew()
        return True

    def _wind_down(self) -> None:
        if self._parked is not None:
            return
        self._halt()
        blocks = 0
        while self._sensed_end() < self._zero_from and blocks < HANDOVER_BLOCKS:
            self.rendering.chain.step(False)
            blocks += 1
