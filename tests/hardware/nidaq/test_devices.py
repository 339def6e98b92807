"""What the driver says of its devices, beside what is configured."""

from collections.abc import Iterator
from dataclasses import replace

import grpc
import nidaqmx._lib
import numpy as np
import pytest
from tests.hardware.nidaq.bench import ACCEL, FORCE, MONITOR, wiring
from tests.hardware.nidaq.fake_device import FakeDevice
from tests.hardware.nidaq.fake_server import FakeServer, Fault
from tests.hardware.nidaq.stub_driver import forget_driver

from frictus_hardware.errors import ConfigError, DriverMissingError, LinkLostError
from frictus_hardware.nidaq.config import Inputs, NiConfig
from frictus_hardware.nidaq.devices import DeviceFacts, mismatches, survey

ACCEL_APART = replace(ACCEL, channels=("ai16", "ai17", "ai18"))
MONITOR_APART = replace(MONITOR, channels=("ai19",))
FACTS = DeviceFacts(
    product="PCIe-6323",
    inputs=tuple(f"ai{index}" for index in range(32)),
    outputs=tuple(f"ao{index}" for index in range(4)),
    terminals={
        f"ai{index}": ("rse", "nrse", *(("differential",) if index % 16 < 8 else ()))
        for index in range(32)
    },
    input_peak_v=10.0,
    output_peak_v=10.0,
    input_rate_hz=250_000.0,
    output_rate_hz=900_000.0,
    simultaneous=False,
)


def apart(**changes: object) -> NiConfig:
    """Return a wiring that fits the device."""
    return wiring(**({"accel": ACCEL_APART, "monitor": MONITOR_APART} | changes))


@pytest.fixture
def server() -> Iterator[FakeServer]:
    with FakeServer(FakeDevice(lambda output_v, _: np.zeros((32, output_v.size)))) as server:
        yield server


def test_a_wiring_that_fits_has_no_mismatch() -> None:
    assert mismatches(apart(), FACTS) == ()


@pytest.mark.parametrize(
    ("changes", "facts", "line"),
    [
        (
            {"monitor": Inputs(("ai40",), terminals="rse")},
            {},
            "monitor.channel = .* no ai40",
        ),
        ({"output": "ao9"}, {}, "output = 'ao9': PCIe-6323 has ao0 to ao3"),
        ({}, {"outputs": ()}, "output = 'ao0': PCIe-6323 has no analogue output"),
        (
            {"accel": replace(ACCEL_APART, channels=("ai24",), terminals="differential")},
            {},
            "accel.terminals = 'differential': ai24 .* can be rse, nrse",
        ),
        ({}, {"input_peak_v": 5.0}, "force.range_v = 10: .* go to 5 V"),
        ({"amplifier_gain": 7.5}, {"output_peak_v": 5.0}, "screen_peak_v = 75 .* goes to 5 V"),
        ({"sample_rate_hz": 30_000.0}, {}, "sample_rate_hz = 30000: the inputs .* 25000 Hz"),
        ({}, {"output_rate_hz": 5_000.0}, "sample_rate_hz = 20000: the output .* 5000 Hz"),
        (
            {"accel": ACCEL},
            {},
            "accel.channels: ai8 is .* lead of the differential ai0",
        ),
    ],
)
def test_each_mismatch_names_its_line(
    changes: dict[str, object], facts: dict[str, object], line: str
) -> None:
    found = mismatches(apart(**changes), replace(FACTS, **facts))  # type: ignore[arg-type]
    with pytest.raises(AssertionError, match=line):
        assert not found, "\n".join(found)


def test_converters_of_their_own_share_neither_rate_nor_leads() -> None:
    own = replace(FACTS, simultaneous=True)
    config = wiring(sample_rate_hz=100_000.0, force=FORCE)
    assert not [text for text in mismatches(config, own) if "rate" in text or "lead" in text]


def test_the_driver_tells_what_there_is(server: FakeServer) -> None:
    found = survey(apart(address=server.address, deadline_s=20.0))
    assert found.driver == "25.25.25"  # the fake gives each part the same number
    assert found.devices == ("Dev1",)
    assert found.facts is not None
    assert found.facts == replace(FACTS, terminals=found.facts.terminals)
    assert set(found.facts.terminals) == set(apart().channels)
    assert found.facts.terminals.items() <= FACTS.terminals.items()
    assert server.device.now == 0  # nothing was driven
    assert not server.device.resets


def test_a_device_that_is_not_there_has_no_facts(server: FakeServer) -> None:
    found = survey(apart(device="Dev7", address=server.address, deadline_s=20.0))
    assert found.devices == ("Dev1",)
    assert found.facts is None


def test_a_server_that_does_not_answer_is_typed(server: FakeServer) -> None:
    config = apart(address=server.address, deadline_s=0.2)
    server.plan(Fault("hang", "GetDeviceAttributeString"))
    with pytest.raises(LinkLostError, match=server.address):
        survey(config)
    server.servicer.faults.clear()  # a busy machine may not have come to it
    server.plan(Fault(grpc.StatusCode.UNAUTHENTICATED, "GetSystemInfoAttributeString"))
    with pytest.raises(ConfigError, match="refuses who we are"):
        survey(replace(config, deadline_s=20.0))
    server.plan(Fault(-200220, "GetDeviceAttributeString"))
    with pytest.raises(ConfigError, match="no device of this name"):
        survey(replace(config, deadline_s=20.0))


def test_without_a_driver_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(nidaqmx._lib, "find_library", lambda _: None)
    forget_driver(monkeypatch)
    with pytest.raises(DriverMissingError, match="Install NI-DAQmx"):
        survey(apart())
