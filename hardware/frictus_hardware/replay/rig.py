"""A recording behind the interface of every rig, and where on its tape the next block lies."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final, NoReturn

import numpy as np
from numpy.typing import NDArray

from frictus_hardware.arguments import MAX_BLOCK_S, ramp_samples, require_drive
from frictus_hardware.arrays import FloatArray
from frictus_hardware.base import Exchange, Opened, RigInfo, TouchReport
from frictus_hardware.errors import (
    ClosedError,
    ConfigError,
    DeviceLostError,
    HardwareError,
    StreamLostError,
)
from frictus_hardware.output import RETURN_S, OutputQueue
from frictus_hardware.replay.tape import ReplayConfig, Tape
from frictus_hardware.simulated.clock import Clock, make_clock, scale_of

SEAM_SAMPLES: Final = 1
"""Between the end of a tape and its next beginning, so that none takes them for neighbours."""


@dataclass(frozen=True, slots=True)
class Cut:
    """A block of a tape.

    Attributes
    ----------
    row : int
        Its first sample among those stored.
    first_sample : int
        The same on the device, laps counted.
    """

    row: int
    first_sample: int


class Playhead:
    """Walks through a tape, block by block; a block never spans a gap.

    Parameters
    ----------
    tape : Tape
        What was recorded.
    loops : bool
        Whether it begins again at the end.
    """

    def __init__(self, tape: Tape, loops: bool) -> None:
        ends = np.append(tape.stretch_row[1:], tape.voltage_v.size)
        self._rows = list(zip(tape.stretch_row.tolist(), ends.tolist(), strict=True))
        self._firsts: list[int] = tape.stretch_first_sample.tolist()
        self._lap_samples = lap_samples(tape)
        self._loops = loops
        self._stretch = 0
        self._row = 0
        self._lap = 0

    def take(self, n_samples: int) -> Cut | None:
        """Return the next block, or None at the end.

        What is left before a gap and fills no block is passed over.

        Parameters
        ----------
        n_samples : int
            At most `longest_stretch` of the tape.
        """
        while self._rows[self._stretch][1] - self._row < n_samples:
            if not self._go_on():
                return None
        begin = self._rows[self._stretch][0]
        first = self._firsts[self._stretch] + self._row - begin
        cut = Cut(self._row, first + self._lap * self._lap_samples)
        self._row += n_samples
        return cut

    def _go_on(self) -> bool:
        last = self._stretch + 1 == len(self._rows)
        if last and not self._loops:
            return False
        self._lap += last
        self._stretch = 0 if last else self._stretch + 1
        self._row = self._rows[self._stretch][0]
        return True


def lap_samples(tape: Tape) -> int:
    """Return by how many device samples one lap is later than the one before."""
    return tape.end_sample - tape.first_sample + SEAM_SAMPLES


def longest_stretch(tape: Tape) -> int:
    """Return the length of the longest stretch without a gap, samples."""
    return int(np.diff(tape.stretch_row, append=tape.voltage_v.size).max())


def touches_of(tape: Tape, loops: bool) -> Iterator[tuple[int, TouchReport]]:
    """Yield the touch reports, each with the device sample during which it arrives."""
    shift = 0
    while tape.touch_arrival_sample.size:
        for row, arrival in enumerate(tape.touch_arrival_sample):
            report = TouchReport(
                measured_sample=float(tape.touch_measured_sample[row]) + shift,
                x_mm=float(tape.touch_x_mm[row]),
                y_mm=float(tape.touch_y_mm[row]),
                in_contact=bool(tape.touch_in_contact[row]),
            )
            yield int(arrival) + shift, report
        if not loops:
            return
        shift += lap_samples(tape)


BETWEEN_GAPS = ", which have to lie between two gaps"
BUFFER_S = 10.0
"""A loop that falls further behind than this has lost the stream."""


class ReplayRig(Opened):
    """See `frictus_hardware.base.Backend`. What is sensed was recorded, and hears no drive.

    The monitor shows the drive of now, as an ideal amplifier plays it: the volts of then would
    contradict it. `voltage_then` has those. What is missing in the recording is an overrun, and
    takes no time. For one thread.

    Parameters
    ----------
    config : ReplayConfig
        File, speed and clock.
    tape : Tape
        What was recorded.
    clock : Clock, optional
        Instead of the configured one.

    Raises
    ------
    ConfigError
        If the tape was recorded at another rate than the configuration says.
    """

    def __init__(self, config: ReplayConfig, tape: Tape, clock: Clock | None = None) -> None:
        if tape.sample_rate_hz != config.sample_rate_hz:
            raise ConfigError(
                f"backend.sample_rate_hz = {config.sample_rate_hz:g}: {config.file} was "
                f"recorded at {tape.sample_rate_hz:g} Hz; give that"
            )
        self.config = config
        self.tape = tape
        self._clock = clock or make_clock(config.clock, config.sample_rate_hz)
        self._loops = config.at_end == "loop"
        self._max_block = min(round(MAX_BLOCK_S * tape.sample_rate_hz), longest_stretch(tape))
        self._open = False
        self._fault: HardwareError | None = None
        self._begin()

    def _begin(self) -> None:
        """Set everything to what holds at the first sample of the tape."""
        tape = self.tape
        first = tape.first_sample
        self._armed = False
        self._playhead = Playhead(tape, self._loops)
        self._touches = touches_of(tape, self._loops)
        self._coming = next(self._touches, None)
        self._sensed = self._ahead = first  # ahead: device samples that the clock has not seen
        self._output = OutputQueue(
            tape.lead_samples + 2 * self._max_block,
            holds=False,
            return_samples=ramp_samples(RETURN_S, tape.sample_rate_hz),
        )
        self._output.write(first, np.zeros(tape.lead_samples), first)

    @property
    def info(self) -> RigInfo:
        """What does not change while the backend is open."""
        tape = self.tape
        steps = {
            "force": (tape.force, tape.force_step_n),
            "accel": (tape.accel, tape.accel_step_m_s2),
        }
        return RigInfo(
            backend=self.config.kind,
            simulated=True,
            # No sensor is there, whatever it was; a substitute stays one.
            finger_source="pointer" if tape.finger_source == "pointer" else "simulated",
            sample_rate_hz=tape.sample_rate_hz,
            clock_scale=scale_of(self.config.clock),
            lead_samples=tape.lead_samples,
            screen_peak_v=tape.screen_peak_v,
            screen_mm=tape.screen_mm,
            touch_latency_s=tape.touch_latency_s,
            converter_steps={
                name: step for name, (raw, step) in steps.items() if raw.dtype.kind == "i"
            },
        )

    @property
    def next_play_sample(self) -> int:
        """Device index at which the next drive handed over will start to play."""
        return self._sensed + self.tape.lead_samples

    def open(self) -> None:
        """Start at the first sample of the recording; disarmed.

        Raises
        ------
        DeviceLostError
            If the recording has been played to its end, and shall stop there.
        """
        if self._open:
            return
        if isinstance(self._fault, DeviceLostError):
            raise self._fault.with_traceback(None)  # or every try would lengthen it
        self._fault = None
        self._begin()
        self._open = True
        self._clock.start()

    def arm(self) -> None:
        """Allow output other than zero.

        Raises
        ------
        ClosedError
            If the rig is not open; or the fault that lasts.
        """
        self._ready()
        self._armed = True

    def exchange(self, drive_v: FloatArray) -> Exchange:
        """Hand over the next block of output; wait for as many recorded samples.

        Parameters
        ----------
        drive_v : ndarray, shape (n_samples,)
            1 sample to 1 s, at most the longest stretch without a gap.
        """
        self._ready()
        drive_v = np.asarray(drive_v, dtype=np.float64)
        require_drive(drive_v, self._max_block, armed=self._armed, besides=BETWEEN_GAPS)
        n_samples = drive_v.size
        cut = self._take(n_samples)
        lost = cut.first_sample - self._sensed
        self._ahead += lost
        now, play = self._now(), cut.first_sample + self.tape.lead_samples
        peak = self.tape.screen_peak_v
        late, applied = self._output.write(play, np.clip(drive_v, -peak, peak), now)
        self._sensed = cut.first_sample + n_samples
        self._clock.wait_until(self._sensed - self._ahead)
        rows = slice(cut.row, cut.row + n_samples)
        return Exchange(
            first_sample=cut.first_sample,
            force_n=_values(self.tape.force[rows], self.tape.force_step_n),
            accel_m_s2=_values(self.tape.accel[rows], self.tape.accel_step_m_s2),
            voltage_v=self._output.read(cut.first_sample, n_samples),
            touches=self._arrived(),
            applied_v=applied,
            play_sample=play,
            clipped_samples=int(np.count_nonzero(np.abs(drive_v) > peak)),
            margin_samples=max(play - now, 0),
            underrun_samples=late + lost,
            overrun_samples=lost,
        )

    def voltage_then(self, first_sample: int, n_samples: int) -> FloatArray:
        """Return the screen volts that were monitored when it was recorded.

        Parameters
        ----------
        first_sample, n_samples : int
            As in an `Exchange`.

        Returns
        -------
        voltage_v : ndarray, shape (n_samples,)
            To the precision of the recording; NaN where samples are missing.
        """
        index = np.arange(first_sample, first_sample + n_samples)
        if self._loops:
            begin, lap = self.tape.first_sample, lap_samples(self.tape)
            index = np.where(index < begin, index, begin + (index - begin) % lap)
        return self.tape.voltage_at(index).astype(np.float64)

    def stop(self, ramp_s: float) -> None:
        """Ramp what is queued to zero within `ramp_s`, drop the rest, and disarm."""
        ramp = ramp_samples(ramp_s, self.tape.sample_rate_hz)
        if self._open and self._armed:
            self._output.ramp(self._now(), ramp)
        self._armed = False

    def health(self) -> str | None:
        """Return what is wrong with the device, or None."""
        if not self._open:
            return "not open"
        return None if self._fault is None else str(self._fault)

    def close(self) -> None:
        """Bring the output to zero. Closing twice is harmless."""
        self.stop(0.0)
        self._open = False

    def _ready(self) -> None:
        if not self._open:
            raise ClosedError("the rig is not open: call open(), or use it in a with statement")
        if self._fault is not None:
            raise self._fault.with_traceback(None)

    def _now(self) -> int:
        """Return the device sample that is about to play."""
        return self._clock.sample() + self._ahead

    def _take(self, n_samples: int) -> Cut:
        if self._now() - self._sensed > BUFFER_S * self.tape.sample_rate_hz:
            self._fail(StreamLostError(f"the loop is more than {BUFFER_S:g} s behind"))
        cut = self._playhead.take(n_samples)
        if cut is None:
            self._fail(DeviceLostError(self._over()))
        return cut

    def _arrived(self) -> tuple[TouchReport, ...]:
        arrived = []
        while self._coming is not None and self._coming[0] < self._sensed:
            arrived.append(self._coming[1])
            self._coming = next(self._touches, None)
        return tuple(arrived)

    def _fail(self, error: HardwareError) -> NoReturn:
        self.stop(0.0)
        self._fault = error
        raise error

    def _over(self) -> str:
        tape = self.tape
        length_s = (tape.end_sample - tape.first_sample) / tape.sample_rate_hz
        return (
            f"the recording {tape.name!r} is over, after {length_s:.2f} s; start anew to play "
            'it again, or set backend.at_end = "loop"'
        )


def _values(raw: NDArray[Any], step: float) -> FloatArray:
    return raw.astype(np.float64) * step
