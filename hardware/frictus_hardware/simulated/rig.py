"""The simulated rig: the twin behind the interface of every rig."""

from dataclasses import replace
from typing import TypeAlias

import numpy as np

from frictus_hardware.arguments import (
    MAX_BLOCK_S,
    ramp_samples,
    require_drive,
    require_longer_lead,
)
from frictus_hardware.arrays import FloatArray
from frictus_hardware.base import Exchange, Opened, RigInfo, TouchReport, Truth
from frictus_hardware.errors import ClosedError, ConfigError, HardwareError, StreamLostError
from frictus_hardware.output import RETURN_S, HandedOver, OutputQueue
from frictus_hardware.physics.twin import Signals, Twin
from frictus_hardware.simulated.clock import Clock, make_clock
from frictus_hardware.simulated.config import SimulatedConfig
from frictus_hardware.simulated.faults import (
    LASTING,
    EmptyOutput,
    FaultPlan,
    LateBlock,
    LostSamples,
)
from frictus_hardware.simulated.guided import GuidedFinger, PointerFinger
from frictus_hardware.simulated.motion import Finger, FingerMotion
from frictus_hardware.simulated.sensors import TouchSensor
from frictus_hardware.simulated.takeover import TakeoverFinger
from frictus_hardware.simulated.twin import info_of, make_twin

INPUT_BUFFER_S = 10.0
"""A loop that falls further behind than this has lost the stream."""


Sensed: TypeAlias = tuple[Signals, Truth, tuple[TouchReport, ...]]


class SimulatedRig(Opened):
    """See `frictus_hardware.base.Backend`; `truth` of an exchange is always there.

    For one thread, except `move_finger`, `guide_finger` and `faults.add`.

    Parameters
    ----------
    config : SimulatedConfig
        Finger, sensors and clock.
    clock : Clock, optional
        Instead of the configured one.
    twin : Twin, optional
        Instead of the standard one, such as one with an effect.
    holds_output : bool
        Whether the output keeps its last value when nothing is handed over, as NI hardware
        does, or goes to zero.
    history_s : float
        Played output to keep for `played`.
    past_v : ndarray, shape (n_samples,), optional
        What the device played before it was opened.
    """

    def __init__(
        self,
        config: SimulatedConfig,
        clock: Clock | None = None,
        twin: Twin | None = None,
        holds_output: bool = False,
        history_s: float = 0.0,
        past_v: FloatArray | None = None,
    ) -> None:
        self.config = config
        self._info = info_of(config)  # asked for in every block
        self.faults = FaultPlan(config.faults)
        self._clock = clock or make_clock(
            config.clock, config.sample_rate_hz, config.clock_skew_ppm
        )
        self._twin = make_twin(config) if twin is None else twin
        self._drifts = twin is None and bool(config.participant.effects)
        # Points of a client and guidance may come while a block plays.
        self._takes_input = config.finger.kind in ("client", "guided", "takeover")
        self._holds_output = holds_output
        self._history_s = history_s
        self._past_v = past_v
        self._max_block = round(MAX_BLOCK_S * config.sample_rate_hz)
        self._open = False
        self._armed = False
        self._lasting: HardwareError | None = None
        self._begin()

    def _begin(self) -> None:
        """Set everything to what holds at sample 0."""
        config = self.config
        rate = config.sample_rate_hz
        lead, longest = self._info.lead_samples, config.max_lead_samples
        capacity = max(lead, longest) + 2 * self._max_block + round(self._history_s * rate)
        self._output = OutputQueue(
            capacity, self._holds_output, ramp_samples(RETURN_S, rate), self._past_v
        )
        self._output.write(0, np.zeros(lead), 0)
        self._touch = TouchSensor(config.touch, rate, config.seed)
        self._finger: Finger = config.finger.start(
            config.screen_mm, np.random.default_rng(config.seed)
        )
        self._states = self._twin.initial()
        self._sensed = 0
        self._twin_until = 0.0
        self._lasting = None

    @property
    def info(self) -> RigInfo:
        """What does not change while the backend is open, but for the lead."""
        return self._info

    @property
    def finger(self) -> Finger:
        """The virtual finger; for measuring, never for rendering."""
        return self._finger

    @property
    def next_play_sample(self) -> int:
        """Device index at which the next drive handed over will start to play."""
        return self._sensed + self._info.lead_samples

    @property
    def armed(self) -> bool:
        """Whether output other than zero is allowed."""
        return self._armed

    def open(self) -> None:
        """Start the sample clock with the lead prefilled with zeros; disarmed."""
        if self._open:
            return
        self._begin()
        self._sense(0, 1)  # compiled and cached parts are called once before time counts
        self._begin()
        self._open = True
        self._clock.start()

    def arm(self) -> None:
        """Allow output other than zero.

        Raises
        ------
        ClosedError
            If the rig is not open.
        """
        self._require_open()
        self._armed = True

    def lengthen_lead(self, lead_samples: int) -> None:
        """Have what is handed over from now on play later; zeros play in between.

        Parameters
        ----------
        lead_samples : int
            The lead in force to that of `max_lead_ms`.
        """
        self._require_open()
        info = self._info
        more = require_longer_lead(
            lead_samples, info.lead_samples, info.max_lead_samples, armed=self._armed
        )
        if more:
            self._output.write(self.next_play_sample, np.zeros(more), self._clock.sample())
            self._info = replace(info, lead_samples=lead_samples)

    def exchange(self, drive_v: FloatArray) -> Exchange:
        """Hand over the next block of output; wait for as many sensed samples.

        Parameters
        ----------
        drive_v : ndarray, shape (n_samples,)
            1 sample to 1 s.
        """
        handed = self.hand_over(drive_v)
        if self._takes_input:
            self.wait(handed)
            return self.sense(handed)
        # What plays meanwhile stands, and so does the finger: computed now, it is there when
        # the block is over, as what a device converts is.
        sensed = self._sense_block(handed)
        self.wait(handed)
        return self._exchanged(handed, sensed)

    def hand_over(self, drive_v: FloatArray) -> HandedOver:
        """Do the first part of an exchange, which does not wait."""
        self._require_open()
        drive_v = np.asarray(drive_v, dtype=np.float64)
        largest_v = require_drive(drive_v, self._max_block, armed=self._armed)
        end = self._sensed + drive_v.size
        self._raise_faults(end)
        lost = self.faults.take(LostSamples, end)
        first = self._sensed + lost
        play = first + self._info.lead_samples
        now = self._clock.sample() + self.faults.take(LateBlock, end)
        peak = self.config.screen_peak_v
        missed = min(self.faults.take(EmptyOutput, end), drive_v.size)
        beyond = 0
        if largest_v > peak:
            beyond = int(np.count_nonzero(np.abs(drive_v) > peak))
            drive_v = np.clip(drive_v, -peak, peak)
        late, applied = self._output.write(play, drive_v, max(now, play + missed))
        return HandedOver(
            first_sample=first,
            applied_v=applied,
            play_sample=play,
            clipped_samples=beyond,
            margin_samples=max(play - lost - now, 0),
            underrun_samples=late + lost,
            overrun_samples=lost,
        )

    def wait(self, handed: HandedOver) -> None:
        """Do the second part of an exchange: wait until its block is over."""
        self._clock.wait_until(handed.end_sample)

    def sense(self, handed: HandedOver) -> Exchange:
        """Do the last part of an exchange: what was sensed meanwhile."""
        return self._exchanged(handed, self._sense_block(handed))

    def _sense_block(self, handed: HandedOver) -> Sensed:
        """Compute what is sensed during an exchange."""
        lost: tuple[TouchReport, ...] = ()
        if handed.overrun_samples:
            _, _, lost = self._sense(self._sensed, handed.overrun_samples)
        signals, motion, arrived = self._sense(handed.first_sample, handed.applied_v.size)
        truth = Truth(
            position_mm=motion.position_mm,
            velocity_mm_s=motion.velocity_mm_s,
            friction_n=signals.friction_n,
            normal_force_n=motion.normal_force_n,
            in_contact=motion.in_contact,
        )
        return signals, truth, lost + arrived

    def _exchanged(self, handed: HandedOver, sensed: Sensed) -> Exchange:
        signals, truth, touches = sensed
        first, n_samples = handed.first_sample, handed.applied_v.size
        self._sensed = handed.end_sample
        return Exchange(
            first_sample=first,
            force_n=self.faults.sensed("force", signals.force_n, first),
            accel_m_s2=self.faults.sensed("accel", signals.accel_m_s2, first),
            voltage_v=self.faults.monitored(signals.voltage_v, first),
            touches=self.faults.touches(touches, first, n_samples),
            applied_v=handed.applied_v,
            play_sample=handed.play_sample,
            clipped_samples=handed.clipped_samples,
            margin_samples=handed.margin_samples,
            underrun_samples=handed.underrun_samples,
            overrun_samples=handed.overrun_samples,
            saturated_samples=n_samples * self.faults.saturates("accel", first, n_samples),
            truth=truth,
        )

    def stop(self, ramp_s: float) -> None:
        """Ramp what is queued to zero within `ramp_s`, drop the rest, and disarm."""
        ramp = ramp_samples(ramp_s, self.config.sample_rate_hz)
        if self._open and self._armed:
            self._output.ramp(self._clock.sample(), ramp)
        self._armed = False

    def silence(self) -> None:
        """Put the output to zero at once, as the reset of a device does."""
        self._output.ramp(self._clock.sample(), 0)
        self._armed = False

    def health(self) -> str | None:
        """Return what is wrong with the device, or None."""
        if not self._open:
            return "not open"
        return None if self._lasting is None else str(self._lasting)

    def close(self) -> None:
        """Bring the output to zero and release the device. Closing twice is harmless."""
        if self._open:
            self.silence()
        self._open = False

    def move_finger(
        self, x_mm: float, y_mm: float, in_contact: bool, normal_force_n: float = 0.4
    ) -> None:
        """Move a finger of kind `client` or `takeover`; from any thread.

        Raises
        ------
        ConfigError
            If the finger is of another kind, or a number out of its range.
        """
        if not isinstance(self._finger, PointerFinger | TakeoverFinger):
            raise ConfigError(
                f"the finger is of kind {self.config.finger.kind!r}: "
                'only one of kind "client" or "takeover" follows points'
            )
        self._finger.push(x_mm, y_mm, in_contact, normal_force_n)

    @property
    def follows_guidance(self) -> bool:
        """Whether the finger is of kind `guided` or `takeover`."""
        return self.config.follows_guidance

    def guide_finger(
        self, speed_mm_s: float, force_n: float, span_mm: tuple[float, float]
    ) -> None:
        """Tell a finger of kind `guided` or `takeover` what to do; from any thread.

        Raises
        ------
        ConfigError
            If the finger is of another kind, or a number out of its range.
        """
        if isinstance(self._finger, GuidedFinger):
            self._finger.push(speed_mm_s, force_n, span_mm)
        elif isinstance(self._finger, TakeoverFinger):
            self._finger.guide(speed_mm_s, force_n, span_mm)
        else:
            raise ConfigError(
                f"the finger is of kind {self.config.finger.kind!r}: "
                'only one of kind "guided" or "takeover" follows guidance'
            )

    @property
    def holding(self) -> bool:
        """Whether the output holds a last value other than zero, for want of another."""
        return self._output.end <= self._clock.sample() and self._output.idle_v != 0.0

    def played(self, n_samples: int) -> tuple[int, FloatArray]:
        """Return the output of the last samples, held values included, and its first index."""
        now = self._clock.sample()
        self._output.settle(now)
        return now - n_samples, self._output.read(now - n_samples, n_samples)

    def _sense(
        self, first: int, n_samples: int
    ) -> tuple[Signals, FingerMotion, tuple[TouchReport, ...]]:
        rate = self.config.sample_rate_hz
        motion = self._finger.at(np.arange(first, first + n_samples) / rate)
        signals = Signals.driven(
            rate,
            self._output.read(first, n_samples),
            motion.position_mm,
            motion.velocity_mm_s,
            motion.normal_force_n,
            motion.in_contact,
        )
        if self._drifts and first >= self._twin_until:
            # To a twin the session's time stands still; its states outlast it.
            self._twin = make_twin(self.config, first / rate / 60.0)
            self._twin_until = first + rate
        signals, self._states = self._twin.run(signals, self._states)
        return signals, motion, self._touch.step(first, motion)

    def _require_open(self) -> None:
        if not self._open:
            raise ClosedError("the rig is not open: call open(), or use it in a with statement")

    def _raise_faults(self, end: int) -> None:
        if self._lasting is not None:
            raise self._lasting
        try:
            behind = self._clock.sample() - end
            if behind > INPUT_BUFFER_S * self.config.sample_rate_hz:
                raise StreamLostError(
                    f"{behind} samples behind the device: its buffer has overflowed"
                )
            self.faults.raise_due(end)
        except LASTING as error:
            self._lasting = error
            raise
