"""A backend that tries again: transient errors are retried for as long as the lead lasts."""

from collections.abc import Callable
from types import TracebackType
from typing import Self

from frictus_hardware.arrays import FloatArray
from frictus_hardware.base import Backend, Exchange, GrowingLead, RigInfo
from frictus_hardware.errors import ConfigError, StreamLostError, TransientError


class RetryingBackend:
    """Passes blocks on to a backend and repeats those it could not take at once.

    The same block is offered again: rendering it anew would tear the finger's motion and the
    cross-fades, which have moved on.

    Parameters
    ----------
    backend : Backend
        An open or unopened rig.
    monotonic_ns : callable
        Monotonic clock, ns.
    """

    def __init__(self, backend: Backend, monotonic_ns: Callable[[], int]) -> None:
        self.inner = backend
        self.retries = 0
        self._monotonic_ns = monotonic_ns

    @property
    def info(self) -> RigInfo:
        """See `Backend`."""
        return self.inner.info

    @property
    def next_play_sample(self) -> int:
        """See `Backend`."""
        return self.inner.next_play_sample

    def open(self) -> None:
        """See `Backend`."""
        self.inner.open()

    def arm(self) -> None:
        """See `Backend`."""
        self.inner.arm()

    def lengthen_lead(self, lead_samples: int) -> None:
        """See `GrowingLead`.

        Parameters
        ----------
        lead_samples : int
            More than now, at most `RigInfo.max_lead_samples`.

        Raises
        ------
        ConfigError
            Also if the backend's lead is fixed.
        """
        if not isinstance(self.inner, GrowingLead):
            raise ConfigError(f"the lead of the backend {self.info.backend} is fixed")
        self.inner.lengthen_lead(lead_samples)

    def exchange(self, drive_v: FloatArray) -> Exchange:
        """Exchange a block, trying again after a transient error.

        Raises
        ------
        StreamLostError
            If it still fails when the lead is used up; or what the backend raises otherwise.
        """
        failing_since_ns: int | None = None
        tries = 0
        while True:
            try:
                return self.inner.exchange(drive_v)
            except TransientError as error:
                self.retries += 1
                tries += 1
                now_ns = self._monotonic_ns()
                if failing_since_ns is None:
                    failing_since_ns = now_ns
                info = self.inner.info
                lead_ns = 1e9 * info.lead_samples / info.clock_hz
                # The count ends it too: a clock that the device drives stands still meanwhile.
                if now_ns - failing_since_ns >= lead_ns or tries > info.lead_samples:
                    raise StreamLostError(
                        f"{tries} tries failed within the lead of {1e-6 * lead_ns:.0f} ms: "
                        f"{error}"
                    ) from error

    def stop(self, ramp_s: float) -> None:
        """See `Backend`."""
        self.inner.stop(ramp_s)

    def health(self) -> str | None:
        """See `Backend`."""
        return self.inner.health()

    def close(self) -> None:
        """See `Backend`."""
        self.inner.close()

    def __enter__(self) -> Self:
        """Open and return self."""
        self.open()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Close, whatever happened."""
        self.close()
