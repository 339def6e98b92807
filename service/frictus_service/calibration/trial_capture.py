"""One trial, gathered from blocks and touch reports by the device's sample count."""

from typing import Final, Literal

import numpy as np

from frictus.block import Block
from frictus.messages import TouchState
from frictus_service.calibration.errors import CaptureError
from frictus_service.study.trial import Trial, TrialInfo

Stream = Literal["force", "accel", "voltage"]

MAX_MISSING: Final = 0.05
"""Of the samples of a stream; a trial that lost more is refused."""
BESIDE_S: Final = 0.15
"""Touch reports just before and after are kept too: the velocity at the ends hangs on them."""
CHANNELS: Final[dict[Stream, int]] = {"force": 3, "accel": 3, "voltage": 1}


class TrialCapture:
    """Takes what arrives, in any order, and keeps what belongs to the trial.

    Parameters
    ----------
    first_sample, n_samples : int
        Of the trial, in device samples.
    sample_rate_hz : float
        Samples per second of the device's clock.
    """

    def __init__(self, first_sample: int, n_samples: int, sample_rate_hz: float) -> None:
        self.first_sample = first_sample
        self.end_sample = first_sample + n_samples
        self.utc_ns = 0
        """UTC of the first sample, once a block has told it."""
        self._rate_hz = sample_rate_hz
        self._data = {
            stream: np.full((n_samples, channels), np.nan)
            for stream, channels in CHANNELS.items()
        }
        self._touches: dict[float, tuple[float, float]] = {}

    def add_block(self, stream: Stream, block: Block) -> None:
        """Take a block; samples outside the trial are left alone."""
        n = block.data.shape[1]
        begin = max(block.first_sample, self.first_sample)
        end = min(block.first_sample + n, self.end_sample)
        if begin >= end:
            return
        source = block.data[:, begin - block.first_sample : end - block.first_sample]
        self._data[stream][begin - self.first_sample : end - self.first_sample] = source.T
        if self.utc_ns == 0:
            since = (self.first_sample - block.first_sample) / self._rate_hz
            self.utc_ns = block.utc_ns + round(1e9 * since)

    def add_touch(self, touch: TouchState) -> None:
        """Take a touch report; those without contact say nothing of the path."""
        at_s = (touch.sample - self.first_sample) / self._rate_hz
        length_s = (self.end_sample - self.first_sample) / self._rate_hz
        if touch.in_contact and -BESIDE_S <= at_s <= length_s + BESIDE_S:
            self._touches[at_s] = (touch.x_mm, touch.y_mm)

    def missing(self) -> dict[Stream, int]:
        """Return how many samples of each stream have not come."""
        return {
            stream: int(np.count_nonzero(np.isnan(data[:, 0])))
            for stream, data in self._data.items()
        }

    def trial(self, info: TrialInfo) -> Trial:
        """Return the trial; what is missing of it is NaN.

        Parameters
        ----------
        info : TrialInfo

        Raises
        ------
        CaptureError
            If more than 5 % of a stream is missing, or the finger was hardly seen.
        """
        n = self.end_sample - self.first_sample
        for stream, count in self.missing().items():
            if count > MAX_MISSING * n:
                raise CaptureError(
                    f"{count} of {n} samples of {stream} did not arrive, at most "
                    f"{100 * MAX_MISSING:g} % may be missing: check the network and the load"
                )
        if len(self._touches) < 4:
            raise CaptureError(
                f"{len(self._touches)} touch reports with contact: the finger was not on the "
                "screen, or its sensor is gone"
            )
        time = np.array(sorted(self._touches))
        return Trial(
            info=info,
            voltage_v=self._data["voltage"][:, 0],
            force_n=self._data["force"],
            accel_m_s2=self._data["accel"],
            skin_velocity_m_s=None,
            position_mm=np.array([self._touches[at] for at in time]),
            position_t_s=time,
            voltage_source="monitor",
        )
