"""Where the NI backend gets touch reports from: a sensor of its own, not on the device."""

from typing import Protocol

from frictus_hardware.base import TouchReport


class TouchSource(Protocol):
    """A touch sensor, or a declared substitute."""

    @property
    def finger_source(self) -> str:
        """`touch`, or `pointer` for a substitute."""
        ...

    @property
    def latency_s(self) -> float:
        """Declared age of a report when it arrives."""
        ...

    def start(self) -> None:
        """Begin with device sample 0, which is about to be taken."""
        ...

    def arrived(self, first_sample: int, n_samples: int) -> tuple[TouchReport, ...]:
        """Return the reports that arrived during device samples that are just over.

        Calls follow one another without gap.
        """
        ...

    def health(self) -> str | None:
        """Return what is wrong with the sensor, or None."""
        ...

    def stop(self) -> None:
        """End; harmless when not started."""
        ...
