"""The lead of the output: transient errors are retried within it, underruns make it longer.

A backend may be a laboratory's own: what it returns is looked at before anything reads it.

It grows at the next arming, never while there is output. A lead that is too short for the
machine interrupts the texture again and again; one that is longer than needed renders the
finger where it no longer is. So it begins short, and grows by what was missing.
"""

from collections.abc import Callable

from frictus_hardware.arrays import FloatArray
from frictus_hardware.base import Backend, Exchange, GrowingLead, Opened, RigInfo
from frictus_hardware.errors import ConfigError, StreamLostError, TransientError
from frictus_hardware.promises import as_promised


class RetryingBackend(Opened):
    """Passes blocks on to a backend, repeats those it could not take, holds it to its promises.

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
        BackendError
            If what the backend returns is not an exchange as promised.
        StreamLostError
            If it still fails when the lead is used up; or what the backend raises otherwise.
        """
        failing_since_ns: int | None = None
        tries = 0
        while True:
            try:
                play_sample = self.inner.next_play_sample
                exchange = self.inner.exchange(drive_v)
                return as_promised(exchange, drive_v.size, play_sample, self.inner.info)
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


def grown_lead(
    lead_samples: int, missing_samples: int, block_samples: int, max_lead_samples: int
) -> int:
    """Return the lead that would have held out, in whole blocks more, within the longest.

    Parameters
    ----------
    lead_samples : int
        In force when samples were missing.
    missing_samples : int
        The longest gap of the output; 0: not known, and one block is added.
    block_samples : int
        Samples of one block.
    max_lead_samples : int
        What the backend accepts; not above `lead_samples`: the lead is fixed.
    """
    blocks = max(1, -(-missing_samples // block_samples))
    return max(lead_samples, min(lead_samples + blocks * block_samples, max_lead_samples))


class LeadGrowth:
    """Remembers the longest gap of the output since the lead was last looked at.

    Parameters
    ----------
    block_samples : int
        Samples of one block.
    """

    def __init__(self, block_samples: int) -> None:
        self._block_samples = block_samples
        self._in_a_row = 0
        self._longest: int | None = None

    def note(self, missing_samples: int) -> None:
        """Take in a block that was handed over while the rig was armed.

        Parameters
        ----------
        missing_samples : int
            How many of its samples came too late to play; blocks in a row make one gap.
        """
        if not missing_samples:
            self._in_a_row = 0
            return
        self._in_a_row += missing_samples
        self._longest = max(self._in_a_row, self._longest or 0)

    def note_run_dry(self) -> None:
        """Take note that the output ran dry and stopped the device; how long is not known."""
        self._in_a_row = 0
        self._longest = self._longest or 0

    def wanted(self, lead_samples: int, max_lead_samples: int) -> int:
        """Return the lead for the next arming.

        Parameters
        ----------
        lead_samples, max_lead_samples : int
            In force, and the longest that the backend accepts.
        """
        if self._longest is None:
            return lead_samples
        return grown_lead(lead_samples, self._longest, self._block_samples, max_lead_samples)

    def forget(self) -> None:
        """Forget what was missing: the lead is what it takes now."""
        self._longest, self._in_a_row = None, 0
