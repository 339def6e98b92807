"""The rig on an NI device. See `frictus_hardware.base.Backend` for what it promises.

The margin of an exchange is what the device still had: at 0 the output runs dry, which stops
it and is a lost stream, so that no exchange ever tells of an underrun.
"""

from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frictus_hardware.arguments import (
    MAX_BLOCK_S,
    ramp_samples,
    require_drive,
    require_longer_lead,
)
from frictus_hardware.arrays import FloatArray
from frictus_hardware.base import Exchange, Opened, RigInfo, TouchReport
from frictus_hardware.errors import (
    ClosedError,
    ConfigError,
    DeviceLostError,
    DriverMissingError,
    HardwareError,
    SensorError,
    TransientError,
)
from frictus_hardware.nidaq.config import NiConfig
from frictus_hardware.nidaq.devices import INSTALL
from frictus_hardware.nidaq.output_feed import OutputFeed
from frictus_hardware.nidaq.sensing import Conversion
from frictus_hardware.nidaq.touch import PointerSource, TouchSource

if TYPE_CHECKING:
    from frictus_hardware.nidaq.session import DeviceSession


@dataclass(slots=True)
class _Turn:
    """An exchange under way: what was accepted, and what has been sensed of it so far."""

    drive_v: FloatArray
    applied_v: FloatArray
    first_sample: int
    margin_samples: int
    clipped_samples: int
    input_v: FloatArray
    sensed_samples: int = 0


class NiRig(Opened):
    """A rig on an NI device, driven by the local driver or through NI's gRPC device server.

    A transient fault leaves the exchange where it is: the same drive offered again goes on
    there. Every other fault of the device puts the output to 0 V first and then lasts until the
    rig is opened anew. For one thread.

    Parameters
    ----------
    config : NiConfig
        The device and what is wired to it.
    conversion : Conversion
        From volts to force, acceleration and screen volts.
    touch : TouchSource
        Where touch reports come from.
    """

    def __init__(self, config: NiConfig, conversion: Conversion, touch: TouchSource) -> None:
        self.config = config
        self.transient_faults = 0
        self._convert = conversion
        self._touch = touch
        self._max_block = round(MAX_BLOCK_S * config.sample_rate_hz)
        self._session: DeviceSession | None = None
        self._fault: HardwareError | None = None
        self._begin(config.lead_samples)

    def _begin(self, lead_samples: int) -> None:
        """Set everything to what holds at sample 0."""
        self._armed = False
        self._fault = None
        self._delivered = 0
        self._turn: _Turn | None = None
        self._feed = OutputFeed(self.config, lead_samples)

    @property
    def info(self) -> RigInfo:
        """What does not change while the backend is open, but for the lead."""
        config = self.config
        return RigInfo(
            backend="nidaqmx",
            simulated=False,
            finger_source=self._touch.finger_source,
            sample_rate_hz=config.sample_rate_hz,
            lead_samples=self._feed.lead_samples,
            max_lead_samples=config.max_lead_samples,
            screen_peak_v=config.screen_peak_v,
            screen_mm=config.screen_mm,
            touch_latency_s=self._touch.latency_s,
            aux=tuple((each.channel.name, each.channel.unit) for each in config.aux),
        )

    @property
    def next_play_sample(self) -> int:
        """Device index at which the next drive handed over will start to play."""
        first = self._feed.sensed_samples if self._turn is None else self._turn.first_sample
        return first + self._feed.lead_samples

    def open(self) -> None:
        """Reset the device and start its clock with the lead prefilled with zeros; disarmed.

        The first opening takes the tare of the force sensor, where it is not configured.

        Raises
        ------
        ConfigError
            If the configuration does not fit the device, or driver or package are missing.
        DeviceLostError, LinkLostError
            If the device or its server cannot be reached.
        SensorError
            If there was a load during the tare, or the force sensor is broken.
        """
        if self._session is not None:
            return
        if self._convert.tare_samples:
            self._tare()
        self._touch.start()
        try:
            self._session = self._started()
        except BaseException:
            self._touch.stop()
            raise

    def _started(self) -> "DeviceSession":
        """Return a session whose clock runs, with the lead prefilled with zeros."""
        session = new_session(self.config)
        self._begin(self._feed.lead_samples)
        try:
            feed = self._feed
            session.device_lead_samples = feed.device_lead_samples
            session.set_up(feed.device_lead_samples + feed.ahead_samples)
            self._convert.start(session.conversion_rate_hz)
            session.start()
            if self._convert.delay_samples:
                self._prime(session)
        except BaseException:
            session.close()
            raise
        return session

    def _prime(self, session: "DeviceSession") -> None:
        wanted = self._convert.delay_samples
        try:
            input_v = session.read(wanted).T
        except HardwareError as error:
            raise _with_outcome(error, session.make_safe()) from error
        if len(input_v) < wanted:
            raise DeviceLostError(
                f"{len(input_v)} of the first {wanted} samples came: the clock of device = "
                f"{self.config.device!r} does not run"
            )
        self._convert.prime(input_v)

    def _tare(self) -> None:
        """Let the force sensor have the volts of a while without load; zeros are played."""
        wanted = self._convert.tare_samples
        session = self._started()
        feed = self._feed
        feed.ahead_samples = feed.to_drop_samples = 0  # no block is late here
        try:
            pieces = []
            while feed.sensed_samples < wanted:
                pieces.append(feed.move(session, wanted - feed.sensed_samples))
            self._convert.tare(np.concatenate(pieces))
        finally:
            session.close()

    def move_finger(
        self, x_mm: float, y_mm: float, in_contact: bool, normal_force_n: float
    ) -> None:
        """Take a point of the declared substitute for a touch sensor; from any thread.

        Parameters
        ----------
        x_mm, y_mm : float
            On the screen.
        in_contact : bool
            Whether the finger touches the screen.
        normal_force_n : float
            Not used: force is measured.

        Raises
        ------
        ConfigError
            If a number is not finite, or the finger is sensed.
        """
        if not isinstance(self._touch, PointerSource):
            raise ConfigError("a touch sensor says where the finger is; no client does")
        self._touch.push(x_mm, y_mm, in_contact)

    def arm(self) -> None:
        """Allow output other than zero.

        Raises
        ------
        ClosedError
            If the rig is not open; or the fault that lasts.
        """
        self._ready()
        self._armed = True

    def lengthen_lead(self, lead_samples: int) -> None:
        """Have what is handed over from now on play later; zeros play in between.

        What is longer goes to the device with the next block; the reserve stays as it is.

        Parameters
        ----------
        lead_samples : int
            The lead in force to that of `max_lead_ms`.

        Raises
        ------
        ConfigError
            If it is out of this range, the output is armed, or an exchange that failed is to
            be offered again.
        ClosedError
            If the rig is not open; or the fault that lasts.
        """
        session = self._ready()
        if self._turn is not None:
            raise ConfigError("an exchange is under way: offer its drive again first")
        more = require_longer_lead(
            lead_samples,
            self._feed.lead_samples,
            self.config.max_lead_samples,
            armed=self._armed,
        )
        if more:
            self._feed.lengthen_lead(lead_samples, self.next_play_sample)
            session.device_lead_samples = self._feed.device_lead_samples

    def exchange(self, drive_v: FloatArray) -> Exchange:
        """Hand over the next block of output; wait for as many sensed samples.

        Parameters
        ----------
        drive_v : ndarray, shape (n_samples,)
            1 sample to 1 s.
        """
        session = self._ready()
        drive_v = np.asarray(drive_v, dtype=np.float64)
        require_drive(drive_v, self._max_block, armed=self._armed)
        try:
            turn = self._take(session, drive_v)
            self._follow(session, turn)
        except TransientError:
            self.transient_faults += 1
            raise
        except HardwareError as error:
            raise self._fail(session, error) from error
        return self._sense(turn)

    def stop(self, ramp_s: float) -> None:
        """Ramp what is queued to zero within `ramp_s`, drop the rest, and disarm.

        The device plays on for its part of the lead before the ramp starts.
        """
        ramp = ramp_samples(ramp_s, self.config.sample_rate_hz)
        if self._armed:
            self._feed.ramp(ramp)
        self._armed = False

    def health(self) -> str | None:
        """Return what is wrong with the device or the touch sensor, or None."""
        if self._session is None:
            return "not open"
        return self._touch.health() if self._fault is None else str(self._fault)

    def close(self) -> None:
        """Play zeros, wait for them, and release the device. Closing twice is harmless.

        Raises
        ------
        HardwareError
            If the output could not be brought to zero; the device is released all the same.
        """
        session, self._session = self._session, None
        if session is None:
            return
        self._armed = False
        try:
            if self._fault is None:
                self._play_out(session)
        finally:
            self._touch.stop()
            session.close()

    def _ready(self) -> "DeviceSession":
        if self._session is None:
            raise ClosedError("the rig is not open: call open(), or use it in a with statement")
        if self._fault is not None:
            raise type(self._fault)(str(self._fault))
        return self._session

    def _take(self, session: "DeviceSession", drive_v: FloatArray) -> _Turn:
        """Queue a drive; or return the exchange under way, if this is the drive it took."""
        under_way = self._turn
        if under_way is not None:
            if np.array_equal(under_way.drive_v, drive_v):
                return under_way
            self._follow(session, under_way)  # given up: what it sensed counts as overrun
            with suppress(SensorError):  # the block is lost anyhow; the next one says it again
                self._convert(under_way.input_v)
            self._turn = None
        self._feed.drop_start(session, self._convert)
        config = self.config
        output_v = np.clip(
            drive_v / config.amplifier_gain, -config.peak_output_v, config.peak_output_v
        )
        # Asked before anything is queued: what fails here is tried again as a whole.
        margin_samples = self._feed.margin_samples(session)
        self._feed.queue(self.next_play_sample, output_v)
        self._turn = _Turn(
            drive_v=drive_v.copy(),
            applied_v=output_v * config.amplifier_gain,
            first_sample=self._feed.sensed_samples,
            margin_samples=margin_samples,
            clipped_samples=int(np.count_nonzero(np.abs(drive_v) > config.screen_peak_v)),
            input_v=np.empty((drive_v.size, len(config.channels))),
        )
        return self._turn

    def _follow(self, session: "DeviceSession", turn: _Turn) -> None:
        """Move blocks until an exchange has been sensed to its end."""
        n_samples = turn.drive_v.size
        while turn.sensed_samples < n_samples:
            done = turn.sensed_samples
            input_v = self._feed.move(session, n_samples - done)
            turn.input_v[done : done + len(input_v)] = input_v
            turn.sensed_samples += len(input_v)

    def _sense(self, turn: _Turn) -> Exchange:
        """Return what an exchange has sensed, with all touches since the one before."""
        since, self._turn = self._delivered, None
        until = self._feed.sensed_samples
        sensed = self._convert(turn.input_v)
        touches: tuple[TouchReport, ...] = self._touch.arrived(since, until - since)
        self._delivered = until
        return Exchange(
            first_sample=turn.first_sample,
            force_n=sensed.force_n,
            accel_m_s2=sensed.accel_m_s2,
            voltage_v=sensed.voltage_v,
            touches=touches,
            applied_v=turn.applied_v,
            play_sample=turn.first_sample + self._feed.lead_samples,
            clipped_samples=turn.clipped_samples,
            margin_samples=turn.margin_samples,
            overrun_samples=turn.first_sample - since,
            saturated_samples=sensed.saturated_samples,
            aux=sensed.aux,
        )

    def _fail(self, session: "DeviceSession", error: HardwareError) -> HardwareError:
        """Put the output to 0 V, and return the fault that lasts from now on."""
        self._armed = False
        self._turn = None
        self._fault = _with_outcome(error, session.make_safe())
        return self._fault

    def _play_out(self, session: "DeviceSession") -> None:
        """Play what the device has, then zeros; stop once zeros are out, and make sure."""
        trouble = self._feed.play_out(session)
        failure = session.make_safe()
        if failure is not None:
            raise _with_outcome(trouble or failure, failure) from failure


def new_session(config: NiConfig) -> "DeviceSession":
    """Return the tasks of a device; `DriverMissingError` without NI's package."""
    try:
        from frictus_hardware.nidaq.session import DeviceSession
    except ModuleNotFoundError as error:
        raise DriverMissingError(
            f"{error}: the NI backend needs it; install it with {INSTALL}"
        ) from error
    return DeviceSession(config)


def _with_outcome(error: HardwareError, failure: HardwareError | None) -> HardwareError:
    """Return a fault of the same kind that also says what became of the output."""
    said = str(error).rstrip(". ")
    if failure is None:
        return type(error)(f"{said}. The output is at 0 V")
    return type(error)(
        f"{said}. THE OUTPUT MAY STILL BE LIVE, switch the amplifier off: {failure}"
    )
