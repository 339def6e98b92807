"""Where the NI backend gets touch reports from: a sensor beside the device, or a client."""

import math
import threading
from collections import deque
from collections.abc import Callable
from typing import Final, Literal, Protocol

from frictus_hardware.base import TouchReport
from frictus_hardware.errors import ConfigError
from frictus_hardware.sensors.hid import TouchLink
from frictus_hardware.sensors.neonode import NeonodeReport
from frictus_hardware.sensors.timing import Alignment, aligned


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


POLL_S: Final = 0.05
REPEAT_S: Final = 1.0 / 60.0
"""A sensor that sees no finger is silent; that it sees none is told this often."""
MOST_WAITING: Final = 1_000


class TouchSensorSource:
    """See `frictus_hardware.nidaq.touch.TouchSource`.

    Parameters
    ----------
    make_link : callable
        From what lets seconds pass, and can be ended early, to a link that is not started.
    sample_rate_hz : float
        Of the device.
    latency_s : float
        Declared age of a report when it arrives.
    clock : callable
        Monotonic seconds, the same as the link's.
    """

    finger_source: Literal["touch"] = "touch"

    def __init__(
        self,
        make_link: Callable[[Callable[[float], object]], TouchLink],
        sample_rate_hz: float,
        latency_s: float,
        clock: Callable[[], float],
    ) -> None:
        self.latency_s = latency_s
        self._make_link = make_link
        self._rate_hz = sample_rate_hz
        self._clock = clock
        self._link: TouchLink | None = None
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None
        self._failure: str | None = None
        self._begin()

    def _begin(self) -> None:
        self._waiting: deque[NeonodeReport] = deque(maxlen=MOST_WAITING)
        self._alignment: Alignment | None = None
        self._counter: Alignment | None = None
        self._last: NeonodeReport | None = None
        self._told_s = 0.0

    def start(self) -> None:
        """Open the sensor and begin to read it; one that is not there is tried again.

        Raises
        ------
        DriverMissingError
            If the package of its port is not installed.
        """
        self.stop()
        self._begin()
        self._failure = None
        self._stopping.clear()
        link = self._make_link(self._stopping.wait)
        link.start()
        self._link = link
        self._thread = threading.Thread(
            target=self._read, args=(link,), name="frictus-touch", daemon=True
        )
        self._thread.start()

    def arrived(self, first_sample: int, n_samples: int) -> tuple[TouchReport, ...]:
        """Return the reports that arrived during device samples that are just over."""
        now_s = self._clock()
        end_sample = first_sample + n_samples
        self._alignment = aligned(self._alignment, end_sample, now_s, self._rate_hz)
        reports = []
        while self._waiting:
            self._last = self._waiting.popleft()
            self._told_s = now_s
            reports.append(self._as_sample(self._last, self._came_s(self._last)))
        silent = self._last is not None and not self._last.in_contact
        if silent and self.health() is None and now_s - self._told_s >= REPEAT_S:
            assert self._last is not None
            self._told_s = now_s
            reports.append(self._as_sample(self._last, now_s))
        return tuple(reports)

    def health(self) -> str | None:
        """Return what is wrong with the sensor, or None."""
        if self._failure is not None or self._link is None:
            return self._failure
        return self._link.touchpad.fault

    def stop(self) -> None:
        """End reading and close the sensor; harmless when not started."""
        self._stopping.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def _came_s(self, report: NeonodeReport) -> float:
        """Return when a report would have come, had nothing held it up, by the host's clock.

        By the sensor's counter, where it sends that: the port and the host hold single reports
        up, by which a finger would seem to run and to rest.
        """
        if report.sensor_s is None:
            return report.arrival_s
        if report.sensor_s == 0.0:
            self._counter = None  # the sensor was enabled anew
        self._counter = aligned(self._counter, report.sensor_s, report.arrival_s, 1.0)
        return report.sensor_s - self._counter.offset

    def _as_sample(self, report: NeonodeReport, arrival_s: float) -> TouchReport:
        assert self._alignment is not None
        measured = self._alignment.sample_at(arrival_s - self.latency_s)
        return TouchReport(measured, report.x_mm, report.y_mm, report.in_contact)

    def _read(self, link: TouchLink) -> None:
        try:
            while not self._stopping.is_set():
                # That a finger was lost needs no telling: its reports end, and grow stale.
                told = link.poll(POLL_S)
                self._waiting.extend(one for one in told if isinstance(one, NeonodeReport))
        except Exception as error:
            self._failure = f"reading the touch sensor ended: {type(error).__name__}: {error}"
        finally:
            link.close()


REPORTS_HZ: Final = 60.0


class PointerSource:
    """See `frictus_hardware.nidaq.touch.TouchSource`.

    Reports the newest point 60 times a second. `push` may be called from any thread.

    Parameters
    ----------
    screen_mm : tuple of float
        Width and height.
    sample_rate_hz : float
        Of the device.
    latency_s : float
        Declared age of a point when it arrives.
    """

    finger_source: Literal["pointer"] = "pointer"

    def __init__(
        self, screen_mm: tuple[float, float], sample_rate_hz: float, latency_s: float
    ) -> None:
        self.latency_s = latency_s
        self._screen_mm = screen_mm
        self._rate_hz = sample_rate_hz
        self._point: tuple[float, float, bool] | None = None
        self._reports = 0

    def push(self, x_mm: float, y_mm: float, in_contact: bool) -> None:
        """Take a point.

        Parameters
        ----------
        x_mm, y_mm : float
            Taken to the nearest place on the screen.
        in_contact : bool

        Raises
        ------
        ConfigError
            If a number is not finite.
        """
        if not (math.isfinite(x_mm) and math.isfinite(y_mm)):
            raise ConfigError(f"point ({x_mm}, {y_mm}) mm: finite millimetres accepted")
        width, height = self._screen_mm
        # Replaced as a whole, so that no reader sees half a point.
        self._point = (min(max(x_mm, 0.0), width), min(max(y_mm, 0.0), height), in_contact)

    def start(self) -> None:
        """Begin with device sample 0; the finger is nowhere until a point comes."""
        self._point = None
        self._reports = 0

    def arrived(self, first_sample: int, n_samples: int) -> tuple[TouchReport, ...]:
        """Return the reports that are due in these samples."""
        reports = []
        period = self._rate_hz / REPORTS_HZ
        while (due := self._reports * period) < first_sample + n_samples:
            self._reports += 1
            if self._point is not None:
                measured = due - self.latency_s * self._rate_hz
                reports.append(TouchReport(measured, *self._point))
        return tuple(reports)

    def health(self) -> str | None:
        """Return None: a pointer that does not move is a pointer."""
        return None

    def stop(self) -> None:
        """Do nothing."""
