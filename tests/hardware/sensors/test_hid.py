"""The HID port and the link over it, against a module with the interface of hidapi."""

import sys
from collections import deque
from types import ModuleType

import pytest
from tests.hardware.sensors.frames import DOWN, MOVE, touch

from frictus_hardware.errors import ClosedError, DeviceLostError, DriverMissingError
from frictus_hardware.sensors.hid import PRODUCT_ID, REPORT_BYTES, VENDOR_ID, HidPort, TouchLink
from frictus_hardware.sensors.neonode import FingerLost, NeonodeReport, Touchpad
from frictus_hardware.sensors.zforce import DETECTION_MODE, ENABLE, REQUEST, RESPONSE


class Sensor:
    """A sensor at the bus: answers every request with its echo."""

    def __init__(self) -> None:
        self.plugged = True
        self.allowed = True
        self.vanishes_at_request = False
        self.opened = b""
        self.handles = 0
        self.requests: list[bytes] = []
        self.outbox: deque[bytes] = deque()
        self.waits_ms: list[int] = []

    def request(self, data: bytes) -> None:
        assert data[0] == REQUEST
        self.requests.append(data)
        self.outbox.append(bytes([RESPONSE]) + data[1:])

    def enumerate(self, vendor_id: int, product_id: int) -> list[dict[str, object]]:
        assert (vendor_id, product_id) == (VENDOR_ID, PRODUCT_ID)
        paths = [(b"screen", 0x0D, "12"), (b"pipe", 0xFF00, "12"), (b"other", 0xFF00, "34")]
        return [
            {"path": path, "usage_page": usage_page, "serial_number": serial}
            for path, usage_page, serial in paths
            if self.plugged
        ]


class Device:
    """As `hid.device`: raises what it raises, returns what it returns."""

    def __init__(self, sensor: Sensor) -> None:
        self._sensor = sensor
        self._is_open = False

    def _check(self, what: str) -> None:
        if not self._is_open:
            raise ValueError("not open")
        if not self._sensor.plugged:
            raise OSError(what)

    def open_path(self, path: bytes) -> None:
        if not self._sensor.allowed:
            raise OSError("open failed")
        self._sensor.opened = path
        self._sensor.handles += 1
        self._is_open = True

    def read(self, max_length: int, timeout_ms: int) -> list[int]:
        assert timeout_ms > 0, "0 would block for ever"
        self._sensor.waits_ms.append(timeout_ms)
        self._check("read error")
        if not self._sensor.outbox:
            return []
        assert max_length >= 1
        return [3 if self._sensor.outbox[0] == b"digitizer" else 2]

    def get_feature_report(self, report_num: int, max_length: int) -> list[int]:
        self._check("read error")
        report = bytes([report_num]) + self._sensor.outbox.popleft()
        return list((report + bytes(64))[:max_length])

    def send_feature_report(self, data: bytes) -> int:
        if not self._is_open:
            raise ValueError("not open")
        if self._sensor.vanishes_at_request:
            self._sensor.plugged = False
        if not self._sensor.plugged:
            return -1
        assert data[0] == 1
        assert len(data) <= REPORT_BYTES
        self._sensor.request(data[1:])
        return len(data)

    def close(self) -> None:
        self._sensor.handles -= self._is_open
        self._is_open = False


@pytest.fixture
def sensor(monkeypatch: pytest.MonkeyPatch) -> Sensor:
    """A plugged sensor behind `import hid`."""
    one = Sensor()
    module = ModuleType("hid")
    module.device = lambda: Device(one)  # type: ignore[attr-defined]
    module.enumerate = one.enumerate  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "hid", module)
    return one


def test_bytes_go_and_come_by_feature_reports(sensor: Sensor) -> None:
    port = HidPort()
    port.open()
    assert port.receive(0.0) == b""
    assert port.receive(0.0101) == b""
    assert sensor.waits_ms == [1, 11]
    port.send(ENABLE)
    assert sensor.requests == [ENABLE]
    assert port.receive(0.01).rstrip(b"\0") == (bytes([RESPONSE]) + ENABLE[1:]).rstrip(b"\0")
    sensor.outbox.append(b"digitizer")
    assert port.receive(0.01) == b""
    port.close()
    port.close()
    assert sensor.handles == 0
    for use in (lambda: port.send(ENABLE), lambda: port.receive(0.01)):
        with pytest.raises(ClosedError, match="1536:0101 is not open"):
            use()


@pytest.mark.parametrize(("serial", "path"), [(None, b"pipe"), ("34", b"other")])
def test_the_pipe_is_opened_and_not_the_screen_of_the_system(
    sensor: Sensor, serial: str | None, path: bytes
) -> None:
    HidPort(serial_number=serial).open()
    assert sensor.opened == path


def test_a_sensor_that_is_not_there_or_not_allowed(sensor: Sensor) -> None:
    with pytest.raises(DeviceLostError, match="not plugged in"):
        HidPort(serial_number="56").open()
    sensor.allowed = False
    with pytest.raises(DeviceLostError, match=r"1536:0101 cannot be opened: open failed.*udev"):
        HidPort().open()
    sensor.plugged = False
    with pytest.raises(DeviceLostError, match="not plugged in"):
        HidPort().open()


def test_unplugging_closes_the_port(sensor: Sensor) -> None:
    port = HidPort()
    for use in (lambda: port.send(ENABLE), lambda: port.receive(0.01)):
        sensor.plugged = True
        port.open()
        sensor.plugged = False
        with pytest.raises(DeviceLostError, match="failed"):
            use()
        assert sensor.handles == 0
        with pytest.raises(ClosedError):
            use()


def test_opening_twice_keeps_one_handle(sensor: Sensor) -> None:
    port = HidPort()
    port.open()
    port.open()
    assert sensor.handles == 1
    port.close()


def test_a_missing_package_tells_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "hid", None)
    with pytest.raises(DriverMissingError, match=r'uv pip install "frictus\[hid\]"'):
        HidPort().open()


def test_another_package_of_the_same_name_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    other = ModuleType("hid")
    other.__file__ = "/site/hid/__init__.py"
    monkeypatch.setitem(sys.modules, "hid", other)
    with pytest.raises(
        DriverMissingError, match=r"/site/hid/__init__\.py is not that of hidapi"
    ):
        HidPort().open()


class Clock:
    """Time that passes only by waiting."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def __call__(self) -> float:
        return self.now_s

    def wait(self, seconds: float) -> None:
        self.now_s += seconds


def linked(sensor: Sensor) -> tuple[TouchLink, Clock]:
    clock = Clock()
    link = TouchLink(Touchpad(reconnect_s=1.0), HidPort(), clock, clock.wait)
    link.start()
    return link, clock


def test_a_link_sets_up_reports_and_survives_unplugging(sensor: Sensor) -> None:
    link, clock = linked(sensor)
    assert link.poll(0.01) == ()
    assert link.poll(0.01) == ()
    assert sensor.requests == [DETECTION_MODE, ENABLE]
    assert link.touchpad.fault is None
    sensor.outbox.append(touch(DOWN, 300))
    (report,) = link.poll(0.01)
    assert isinstance(report, NeonodeReport)
    assert report.x_mm == 30.0

    sensor.plugged = False
    sensor.outbox.clear()
    (lost,) = link.poll(0.01)
    assert isinstance(lost, FingerLost)
    assert link.touchpad.fault is not None
    assert "read failed" in link.touchpad.fault
    for _ in range(25):
        assert link.poll(0.1) == ()
    assert "cannot be opened" in link.touchpad.fault
    assert link.touchpad.counts.reconnects == 2

    sensor.plugged = True
    clock.now_s += 1.0
    for _ in range(3):
        link.poll(0.01)
    assert link.touchpad.fault is None
    sensor.outbox.append(touch(MOVE, 310))
    assert len(link.poll(0.01)) == 1
    link.close()
    assert sensor.handles == 0


def test_a_link_to_a_sensor_that_is_not_there_yet(sensor: Sensor) -> None:
    sensor.plugged = False
    link, _ = linked(sensor)
    assert link.touchpad.fault is not None
    assert "cannot be opened" in link.touchpad.fault
    sensor.plugged = True
    for _ in range(14):
        link.poll(0.1)
    assert link.touchpad.fault is None
    link.close()


def test_a_link_whose_sensor_vanishes_before_the_request_is_sent(sensor: Sensor) -> None:
    sensor.vanishes_at_request = True
    link, _ = linked(sensor)
    assert sensor.handles == 0
    assert link.touchpad.fault is not None
    assert "write failed" in link.touchpad.fault


def test_a_link_without_the_package_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "hid", None)
    clock = Clock()
    with pytest.raises(DriverMissingError):
        TouchLink(Touchpad(), HidPort(), clock, clock.wait).start()
