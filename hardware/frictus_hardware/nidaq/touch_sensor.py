"""A touch sensor beside the device, read by a thread of its own."""

import threading
from collections import deque
from collections.abc import Callable
from typing import Final, Literal

from frictus_hardware.base import TouchReport
from frictus_hardware.sensors.alignment import Alignment, aligned
from frictus_hardware.sensors.neonode import NeonodeReport
from frictus_hardware.sensors.touch_link import TouchLink

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
