"""What the sensors of a rig make of the volts, from the configuration file on."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
from tests.hardware.nidaq.fake_device import FakeDevice
from tests.hardware.nidaq.fake_server import FakeServer, Fault
from tests.hardware.nidaq.wired import BIAS_V, section, sensor_volts

from frictus_hardware.arrays import FloatArray
from frictus_hardware.errors import ConfigError, SensorError, TransientError
from frictus_hardware.nidaq.assembly import conversion_of, make_rig
from frictus_hardware.nidaq.backend import NiRig
from frictus_hardware.nidaq.settings import NiRigConfig
from frictus_service.config_file import parse
from frictus_service.errors import ConfigurationError

RATE_HZ = 20_000.0
CHANNELS = 10
AXES = np.array([1.0, -0.5, 2.0])


def from_text(text: str, folder: Path) -> NiRigConfig:
    config = parse(text, folder / "frictus.toml")
    assert isinstance(config.backend, NiRigConfig)
    return config.backend


def configured(folder: Path, address: str) -> NiRigConfig:
    return from_text(section(folder, address), folder)


class World:
    """What happens to the sensors; the device takes the channels in turn."""

    def __init__(self, tone_hz: float = 0.0, load_n: float = 0.0) -> None:
        self.tone_hz = tone_hz
        self.load_n = load_n
        self.broken = False

    def force_n(self, time_s: FloatArray) -> FloatArray:
        tone: FloatArray = np.sin(2.0 * np.pi * self.tone_hz * time_s)
        force_n: FloatArray = (0.3 * tone + self.load_n)[:, np.newaxis] * AXES
        return force_n

    def __call__(self, output_v: FloatArray, first_sample: int) -> FloatArray:
        volts = []
        for channel in range(CHANNELS):
            ticks = np.arange(output_v.size, dtype=np.float64) + channel / CHANNELS
            ticks += first_sample
            force_n = self.force_n(ticks / RATE_HZ)
            volts.append(sensor_volts(force_n, 10.0 * force_n, output_v)[channel])
        if self.broken:
            volts[2][-1] = 10.0
        return np.array(volts)


Maker = Callable[[World], tuple[NiRig, FakeServer]]


@pytest.fixture
def make(tmp_path: Path) -> Iterator[Maker]:
    """A maker of rigs in a world."""
    with ExitStack() as stack:

        def make_one(world: World) -> tuple[NiRig, FakeServer]:
            server = stack.enter_context(FakeServer(FakeDevice(world)))
            return make_rig(configured(tmp_path, server.address)), server

        yield make_one


def tared(folder: Path, address: str) -> NiRigConfig:
    found = configured(folder, address)
    force = found.force.model_copy(update={"bias_v": tuple(BIAS_V.tolist())})
    return found.model_copy(update={"force": force})


def test_all_channels_are_of_one_time_and_of_the_sample_told(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    """The converter is 45 us from the first channel to the last: 16 degrees at 1 kHz."""
    world = World(tone_hz=1_000.0)
    with (
        FakeServer(FakeDevice(world)) as server,
        make_rig(tared(tmp_path, server.address)) as rig,
    ):
        blocks = [rig.exchange(np.zeros(size)) for size in rng.integers(1, 300, 12)]
    force_n = np.concatenate([block.force_n for block in blocks])[8:]
    accel = np.concatenate([block.accel_m_s2 for block in blocks])[8:]
    expected = world.force_n((8 + np.arange(len(force_n))) / RATE_HZ)
    np.testing.assert_allclose(force_n, expected, atol=1e-6)
    np.testing.assert_allclose(accel, 10.0 * expected, atol=1e-5)


def test_the_monitor_is_of_the_sample_at_which_the_drive_plays(tmp_path: Path) -> None:
    with (
        FakeServer(FakeDevice(World())) as server,
        make_rig(tared(tmp_path, server.address)) as rig,
    ):
        rig.arm()
        drive_v = np.concatenate([np.linspace(0.0, 50.0, 1_000), np.full(1_000, 50.0)])
        got = [rig.exchange(part) for part in np.split(drive_v, 10)]
    lead = got[0].play_sample
    monitor_v = np.concatenate([block.voltage_v for block in got])
    np.testing.assert_allclose(monitor_v[lead:], drive_v[:-lead], atol=0.1)
    np.testing.assert_allclose(monitor_v[: lead - 4], 0.0, atol=1e-9)


def test_the_tare_is_taken_once_and_kept_over_a_lost_stream(make: Maker) -> None:
    world = World()
    rig, server = make(world)
    with rig:
        world.load_n = 0.5
        rig.exchange(np.zeros(100))
        server.plan(Fault(-200290, "ReadAnalogF64"))
        with pytest.raises(Exception, match="ran dry"):
            rig.exchange(np.zeros(100))
    with rig:  # the finger is on the screen now
        force_n = rig.exchange(np.zeros(100)).force_n
    np.testing.assert_allclose(force_n[20:], np.tile(0.5 * AXES, (80, 1)), atol=1e-6)


def test_a_finger_on_the_screen_spoils_the_tare(make: Maker) -> None:
    world = World(tone_hz=2.0)
    rig, server = make(world)
    with pytest.raises(SensorError, match=r"no tare: the force along . of the sensor moved"):
        rig.open()
    assert server.device.output_v == 0.0
    assert not server.device.tasks
    world.tone_hz = 0.0
    with rig:
        np.testing.assert_allclose(rig.exchange(np.zeros(10)).force_n, 0.0, atol=1e-6)


def test_an_overload_is_told_and_passes(make: Maker) -> None:
    world = World()
    rig, _ = make(world)
    with rig:
        rig.exchange(np.zeros(100))
        world.broken = True
        with pytest.raises(SensorError, match="FT01234: gauge 3 in 1 of 100 samples"):
            rig.exchange(np.zeros(100))
        world.broken = False
        assert rig.exchange(np.zeros(50)).overrun_samples == 100
        np.testing.assert_allclose(rig.exchange(np.zeros(50)).force_n, 0.0, atol=1e-6)


def test_a_converter_of_less_range_than_its_sensor_is_at_its_end_first(tmp_path: Path) -> None:
    found = tared(tmp_path, "127.0.0.1:1")
    less = {
        "force": found.force.model_copy(update={"range_v": 5.0}),
        "accel": found.accel.model_copy(update={"range_v": 1.0}),
    }
    convert = conversion_of(found.model_copy(update=less))
    convert.start(RATE_HZ * CHANNELS)
    rest = sensor_volts(np.zeros((8, 3)), np.zeros((8, 3)), np.zeros(8)).T
    convert.prime(rest[:3])
    assert convert(rest).saturated_samples == 0
    cut_off = rest.copy()
    cut_off[5:, 6] = 1.0
    assert convert(cut_off).saturated_samples == 3
    cut_off[5:, 2] = -5.0
    with pytest.raises(SensorError, match=r"gauge 3 in 3 of 8 samples .* -5 to 5 V"):
        convert(cut_off)


def test_a_block_given_up_leaves_no_seam_in_what_follows(make: Maker) -> None:
    world = World(tone_hz=0.0)
    rig, server = make(world)
    with rig:
        world.tone_hz = 50.0
        rig.exchange(np.zeros(100))
        server.plan(Fault(-200284, "ReadAnalogF64"))
        with pytest.raises(TransientError):
            rig.exchange(np.zeros(100))
        got = rig.exchange(np.zeros(50))
        assert (got.first_sample, got.overrun_samples) == (200, 100)
        expected = world.force_n((200 + np.arange(50)) / RATE_HZ)
        np.testing.assert_allclose(got.force_n, expected, atol=1e-6)


AUX = """
[[backend.aux]]
name = "room"
unit = "degC"
channel = "ai18"
scale = 100.0
offset = -50.0

[[backend.aux]]
name = "humidity"
unit = "%"
channel = "ai19"
scale = 10.0
range_v = 5.0
"""


def test_further_channels_come_in_their_units_and_in_step(tmp_path: Path) -> None:
    def plant(output_v: FloatArray, first_sample: int) -> FloatArray:
        index = np.arange(first_sample, first_sample + output_v.size)
        rest = World()(output_v, first_sample)
        # The converter takes them 10 and 11 twelfths of a sample after the edge.
        room_v = 0.7 + 1e-5 * (index + 10.0 / 12.0)
        return np.vstack([rest, room_v, np.where(index < 300, 4.0, 5.0)])

    with FakeServer(FakeDevice(plant)) as server:
        config = from_text(section(tmp_path, server.address) + AUX, tmp_path)
        with make_rig(config) as rig:
            assert rig.info.aux == (("room", "degC"), ("humidity", "%"))
            first, second = rig.exchange(np.zeros(200)), rig.exchange(np.zeros(200))
    assert first.aux is not None
    assert second.aux is not None
    room = np.concatenate([first.aux, second.aux])[8:, 0]
    np.testing.assert_allclose(room, 100.0 * (0.7 + 1e-5 * np.arange(8, 400)) - 50.0, atol=1e-6)
    np.testing.assert_allclose(first.aux[8:, 1], 40.0, atol=1e-9)
    assert (first.saturated_samples, second.saturated_samples) == (0, 103)


def test_saturated_accelerations_are_counted(make: Maker) -> None:
    world = World(load_n=0.0)
    rig, _ = make(world)
    with rig:
        assert rig.exchange(np.zeros(50)).saturated_samples == 0
        world.load_n = 15.0  # 15 g of acceleration
        assert rig.exchange(np.zeros(50)).saturated_samples > 40


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('calibration = "FT01234.cal"', 'calibration = "absent.cal"', ["absent.cal", "read"]),
        ('"ai16"]', "]", ["accel.channels", "3 channels"]),
        ('"ai16"]', '"ai17"]', ["ai17 is also in accel.channels"]),
        ('"ai16"]', '"b16"]', ["backend.accel.channels", "b16"]),
        ("[backend.touch]", AUX.replace("ai18", "ai0") + "[backend.touch]", ["ai0 is also in"]),
        ('kind = "pointer"', 'kind = "mouse"', ["backend.touch", "'neonode'", "'pointer'"]),
        ('[["x", 180.0]]', '[["w", 180.0]]', ["backend.accel.rotation", "'w'"]),
        ("deadline_s = 20.0", "screen_peak_v = 80.0", ["screen_peak_v = 80"]),
        (
            "deadline_s = 20.0",
            "lead_ms = 12.0\nreserve_ms = 12.0",
            ["lead_ms = 12", "raise lead_ms"],
        ),
    ],
)
def test_what_does_not_fit_is_named(
    tmp_path: Path, old: str, new: str, words: list[str]
) -> None:
    text = section(tmp_path)
    assert old in text
    with pytest.raises((ConfigurationError, ConfigError)) as raised:
        make_rig(from_text(text.replace(old, new), tmp_path))
    for word in words:
        assert word in str(raised.value)


def test_a_point_is_refused_where_a_sensor_tells(make: Maker) -> None:
    rig, _ = make(World())
    assert rig.info.finger_source == "pointer"
    with rig:
        rig.move_finger(10.0, 99.0, True, 0.3)
        touches = rig.exchange(np.zeros(400)).touches
        assert [(t.x_mm, t.y_mm, t.in_contact) for t in touches] == [(10.0, 35.0, True)] * 2
        with pytest.raises(ConfigError, match="finite"):
            rig.move_finger(np.nan, 0.0, True, 0.3)
