"""Output and input of a device in step: what is queued, what is in the device, what was sensed.

The lead has two parts. What is in the device can no longer be changed: DAQmx has moved it to
the device's own memory. The reserve is kept here, so that a stop can still ramp it down.
"""

from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

from frictus_hardware.arguments import MAX_BLOCK_S, ramp_samples
from frictus_hardware.arrays import FloatArray
from frictus_hardware.errors import HardwareError, SensorError, TransientError
from frictus_hardware.nidaq.config import NiConfig
from frictus_hardware.nidaq.sensing import Conversion
from frictus_hardware.output import RETURN_S, OutputQueue

if TYPE_CHECKING:
    from frictus_hardware.nidaq.session import DeviceSession


class OutputFeed:
    """Feeds a device from sample 0 on, zeros first, and counts what was sensed.

    Parameters
    ----------
    config : NiConfig
        The device and what is wired to it.
    lead_samples : int
        From handing a drive over to its playing.

    Attributes
    ----------
    lead_samples : int
        In force; it may become longer.
    sensed_samples : int
        Read from the device so far.
    ahead_samples : int
        Zeros beyond the lead, with which the clock starts.
    to_drop_samples : int
        Of what is sensed meanwhile, not yet dropped.
    """

    def __init__(self, config: NiConfig, lead_samples: int) -> None:
        self._config = config
        self.lead_samples = lead_samples
        self.sensed_samples = 0
        self._written = self.device_lead_samples
        self.ahead_samples = max(config.start_samples - self.device_lead_samples, 0)
        self.to_drop_samples = self.ahead_samples
        self._queue = OutputQueue(
            config.max_lead_samples + 2 * round(MAX_BLOCK_S * config.sample_rate_hz),
            holds=False,
            return_samples=ramp_samples(RETURN_S, config.sample_rate_hz),
        )
        self._queue.write(0, np.zeros(lead_samples), 0)

    @property
    def device_lead_samples(self) -> int:
        """The part of the lead that is in the device and can no longer be changed."""
        return self.lead_samples - self._config.reserve_samples

    def queue(self, first_sample: int, output_v: FloatArray) -> None:
        """Queue an output.

        Parameters
        ----------
        first_sample : int
            At which it begins to play.
        output_v : ndarray, shape (n_samples,)
            At the terminals of the device.
        """
        self._queue.write(first_sample, output_v, 0)

    def lengthen_lead(self, lead_samples: int, first_sample: int) -> None:
        """Play zeros from a sample on for as long as the lead becomes longer.

        Parameters
        ----------
        lead_samples : int
            Longer than that in force.
        first_sample : int
            At which the next drive would have played.
        """
        self.queue(first_sample, np.zeros(lead_samples - self.lead_samples))
        self.lead_samples = lead_samples

    def margin_samples(self, session: "DeviceSession") -> int:
        """Return what the device still has to play; at 0 the output runs dry."""
        return max(self._written + self.ahead_samples - session.acquired(), 0)

    def ramp(self, n_samples: int) -> None:
        """Ramp to zero what is not in the device yet, and drop the rest."""
        self._queue.ramp(self._written, n_samples)

    def move(self, session: "DeviceSession", n_samples: int) -> FloatArray:
        """Feed the output for one block at most, and return the inputs of the same time.

        Parameters
        ----------
        session : DeviceSession
            Its clock runs.
        n_samples : int
            At the most.

        Returns
        -------
        ndarray, shape (n_moved, n_channels)

        Raises
        ------
        TransientError
            If nothing came in time, or the output found no room; it may be tried again.
        """
        n_samples = min(n_samples, self._config.block_samples)
        until = self.sensed_samples + n_samples + self.device_lead_samples
        if until > self._written:
            output_v = self._queue.read(self._written, until - self._written)
            self._written += session.write(output_v)
            if self._written < until:
                raise TransientError(
                    f"the output had no room for {until - self._written} of "
                    f"{output_v.size} samples at sample {self.sensed_samples}"
                )
        input_v = session.read(n_samples).T
        if not len(input_v):
            raise TransientError(
                f"none of {n_samples} samples came in time at sample {self.sensed_samples}"
            )
        self.sensed_samples += len(input_v)
        return input_v

    def drop_start(self, session: "DeviceSession", convert: Conversion) -> None:
        """Drop what was sensed before all that is in the device is the lead, no more.

        Parameters
        ----------
        session : DeviceSession
            Its clock runs.
        convert : Conversion
            It has a memory, which must not miss a sample.

        Raises
        ------
        TransientError
            If nothing came in time; it may be tried again.
        """
        while self.to_drop_samples:
            n_samples = min(self.to_drop_samples, self._config.block_samples)
            input_v = session.read(n_samples).T
            if not len(input_v):
                raise TransientError("no sample came in time after the clock's start")
            self.to_drop_samples -= len(input_v)
            with suppress(SensorError):
                convert(input_v)

    def play_out(self, session: "DeviceSession") -> HardwareError | None:
        """Play what the device has, then zeros, and stop; return what went wrong."""
        self.ramp(0)
        until = self._written + 1
        try:
            while self.sensed_samples < until:
                self.move(session, until - self.sensed_samples)
            session.stop()
        except HardwareError as error:
            return error
        return None
