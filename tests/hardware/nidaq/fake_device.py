"""An X Series device whose clock stands still but for what is read: nothing is ever late.

Of time it knows only the inputs' sample clock. The output takes one sample of its queue
per tick; it holds its last value when the queue runs dry, when its task stops or when it fails.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from frictus_hardware.arrays import FloatArray

Plant = Callable[[FloatArray, int], FloatArray]
"""From output volts and the first's device index to (n_channels, n_samples) input volts."""

INPUTS, OUTPUTS = 32, 4
RANGE_V = 10.0
MAX_CONVERSIONS_HZ = 250_000.0
MAX_OUTPUT_HZ = 900_000.0
MEMORY = 8_191
"""Samples that the output takes out of its buffer in advance."""

RAN_DRY, OVERWRITTEN, ABORTED, TASK_GONE = -200290, -200279, -88710, -200088
EXPIRED = -200990
"""Made up: what the driver says of a watchdog that has expired is not known here."""
NOT_YET, FULL, NO_DEVICE, NO_CHANNEL = -200284, -200292, -200220, -200170
TOO_FAST, BEYOND_RANGE, RESERVED, BAD_VALUE = -200081, -200561, -50103, -200077
NO_SETTING = -200452


PCIE, USB = 13612, 12586
EMPTY, HALF_FULL, NOT_FULL = 10235, 10239, 10242
"""When output is moved from the computer's buffer to the device's memory."""


class FakeDaqError(Exception):
    def __init__(self, code: int, read: int | None = None, written: int | None = None) -> None:
        super().__init__(f"fault {code} of the fake device")
        self.code = code
        self.read = read
        self.written = written


@dataclass
class FakeTask:
    name: str
    kind: str = ""
    channels: list[str] = field(default_factory=list)
    limit_v: float = RANGE_V
    rate_hz: float = 0.0
    clock: str = ""
    regenerates: bool = True
    buffer: int = 0
    transfer: int = HALF_FULL
    running: bool = False
    error: int = 0
    queue: FloatArray = field(default_factory=lambda: np.zeros(0))
    """Output still to play."""
    unread: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    acquired: int = 0


@dataclass
class Watched:
    """A watchdog timer and the lines that it pulls low."""

    timeout_s: float
    lines: list[str] = field(default_factory=list)
    running: bool = False
    fed_at: int = 0
    expired: bool = False


class FakeDevice:
    def __init__(
        self,
        plant: Plant,
        name: str = "Dev1",
        record: bool = False,
        at_one_time: bool = False,
        bus: int = PCIE,
    ) -> None:
        self.name = name
        self.bus = bus
        self.at_one_time = at_one_time
        """Whether it has a converter for each channel, as some devices have."""
        self.present = True
        self.output_v = 0.0
        self.now = 0
        """Ticks since the inputs were started last."""
        self.resets = 0
        self.tasks: dict[str, FakeTask] = {}
        self.lines: dict[str, bool] = {}
        """Levels of the digital lines."""
        self.watched: dict[str, Watched] = {}
        self._plant = plant
        self._record = record
        self._played: list[FloatArray] = []

    @property
    def played_v(self) -> FloatArray:
        """What was output since the inputs were started last, per tick."""
        return np.concatenate([np.zeros(0), *self._played])

    def pass_time(self, ticks: int) -> None:
        """Let the clock run; it does so only while the inputs do."""
        inputs = self._running("ai")
        if inputs is None or ticks <= 0:
            return
        out_v = np.full(ticks, self.output_v)
        output = self._running("ao")
        if output is not None:
            count = min(ticks, output.queue.size)
            out_v[:count] = output.queue[:count]
            out_v[count:] = out_v[count - 1] if count else self.output_v
            output.queue = output.queue[count:]
            if count < ticks and not output.regenerates:
                output.error = RAN_DRY
        self._watch(ticks, inputs.rate_hz)
        self.output_v = float(out_v[-1])
        if self._record:
            self._played.append(out_v)
        sensed_v = self._plant(out_v, self.now)[: len(inputs.channels)]
        inputs.unread = np.concatenate([inputs.unread, sensed_v], axis=1)
        inputs.acquired += ticks
        self.now += ticks
        if inputs.unread.shape[1] > inputs.buffer:
            inputs.error = OVERWRITTEN

    def _watch(self, ticks: int, rate_hz: float) -> None:
        for one in self.watched.values():
            if one.running and self.now + ticks - one.fed_at > one.timeout_s * rate_hz:
                one.expired = True
                self.lines |= dict.fromkeys(one.lines, False)

    def feed(self, name: str) -> None:
        """Reset a watchdog's timer."""
        if self.watched[name].expired:
            raise FakeDaqError(EXPIRED)
        self.watched[name].fed_at = self.now

    def fail(self, code: int) -> None:
        """End every running task with an error; the output holds its last value."""
        for task in self.tasks.values():
            if task.running:
                task.error = code

    def task(self, name: str) -> FakeTask:
        if name not in self.tasks:
            raise FakeDaqError(TASK_GONE)
        return self.tasks[name]

    def healthy(self, name: str) -> FakeTask:
        task = self.task(name)
        if task.error:
            raise FakeDaqError(task.error)
        return task

    def add_channels(self, task: FakeTask, kind: str, names: str, limit_v: float) -> None:
        if limit_v > RANGE_V:
            raise FakeDaqError(BAD_VALUE)
        for name in names.replace(" ", "").split(","):
            device, _, channel = name.partition("/")
            self.require(device)
            count = INPUTS if kind == "ai" else OUTPUTS
            if channel not in {f"{kind}{index}" for index in range(count)}:
                raise FakeDaqError(NO_CHANNEL)
            task.channels.append(name)
        task.kind = kind
        task.limit_v = limit_v

    def listed(self, kind: str) -> str:
        """Return its channels of a kind as the driver lists them."""
        count = INPUTS if kind == "ai" else OUTPUTS
        return ", ".join(f"{self.name}/{kind}{index}" for index in range(count))

    def require(self, device: str) -> None:
        if device != self.name or not self.present:
            raise FakeDaqError(NO_DEVICE)

    def set_clock(self, task: FakeTask, rate_hz: float, source: str, buffer: int) -> None:
        if task.kind == "ai" and rate_hz * len(task.channels) > MAX_CONVERSIONS_HZ:
            raise FakeDaqError(TOO_FAST)
        task.rate_hz, task.clock, task.buffer = rate_hz, source, buffer

    def set_transfer(self, task: FakeTask, condition: int) -> None:
        """Choose when output is moved; on USB the driver does it in its own way."""
        if self.bus == USB:
            raise FakeDaqError(NO_SETTING)
        task.transfer = condition

    def start(self, task: FakeTask) -> None:
        self.require(self.name)
        if self._running(task.kind) is not None:
            raise FakeDaqError(RESERVED)
        if task.kind == "ai":
            self.now = 0
            self._played.clear()
            task.unread = np.zeros((len(task.channels), 0))
            task.acquired = 0
        elif task.clock != f"/{self.name}/ai/SampleClock":
            raise FakeDaqError(BAD_VALUE)
        task.running = True

    def stop(self, task: FakeTask) -> None:
        error, task.error = task.error, 0
        task.running = False
        task.queue = np.zeros(0)
        if error:
            raise FakeDaqError(error)

    def write(self, task: FakeTask, values_v: FloatArray, timeout_s: float) -> int:
        if task.error:
            raise FakeDaqError(task.error, written=0)
        if np.any(np.abs(values_v) > task.limit_v):
            raise FakeDaqError(BEYOND_RANGE, written=0)
        room = task.buffer + (MEMORY if task.running else 0) - task.queue.size
        if room < values_v.size and task.running:
            waited = min(values_v.size - room, round(timeout_s * task.rate_hz))
            self.pass_time(waited)
            room += waited
        count = max(min(room, values_v.size), 0)
        task.queue = np.concatenate([task.queue, values_v[:count]])
        if count < values_v.size:
            raise FakeDaqError(FULL, written=count)
        return count

    def write_at_once(self, task: FakeTask, value_v: float) -> None:
        self.require(self.name)
        if self._running("ao") is not None:
            raise FakeDaqError(RESERVED)
        if abs(value_v) > task.limit_v:
            raise FakeDaqError(BEYOND_RANGE, written=0)
        self.output_v = value_v

    def read(self, task: FakeTask, n_samples: int, timeout_s: float) -> FloatArray:
        """Return the samples; fewer if the time ends before."""
        if task.error:
            raise FakeDaqError(task.error, read=0)
        missing = n_samples - task.unread.shape[1]
        self.pass_time(min(missing, round(timeout_s * task.rate_hz)))
        if task.error:
            raise FakeDaqError(task.error, read=0)
        values, task.unread = task.unread[:, :n_samples], task.unread[:, n_samples:]
        return values

    def reset(self) -> None:
        self.fail(ABORTED)
        for task in self.tasks.values():
            task.running = False
        self.output_v = 0.0
        self.lines.clear()
        self.watched.clear()
        self.resets += 1

    def _running(self, kind: str) -> FakeTask | None:
        for task in self.tasks.values():
            if task.kind == kind and task.running and not task.error:
                return task
        return None
