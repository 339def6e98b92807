"""The path without a server: nidaqmx calls the driver library of this machine."""

import nidaqmx._lib
import numpy as np
import pytest
from tests.hardware.nidaq.stub_driver import StubDriver, forget_driver, make_local_rig

from frictus_hardware.errors import (
    ConfigError,
    DeviceLostError,
    HardwareError,
    StreamLostError,
    TransientError,
)
from frictus_hardware.nidaq.backend import NiRig
from frictus_hardware.nidaq.driver import UnlistedFaultError


def run(rig: NiRig, rng: np.random.Generator) -> None:
    for _ in range(60):
        rig.exchange(rng.uniform(30.0, 75.0, 100))


@pytest.mark.parametrize(
    ("code", "kind"),
    [
        (-200290, StreamLostError),
        (-200361, StreamLostError),
        (-88710, DeviceLostError),
        (-200045, DeviceLostError),
        (-209999, UnlistedFaultError),
    ],
)
def test_a_fault_of_the_driver_is_typed_and_the_output_at_zero(
    stub_driver: StubDriver, rng: np.random.Generator, code: int, kind: type[HardwareError]
) -> None:
    stub_driver.plan(code, int(rng.integers(700, 3_000)))
    with make_local_rig() as rig:
        rig.arm()
        with pytest.raises(kind, match=f"{code}.*The output is at 0 V"):
            run(rig, rng)
        assert stub_driver.output_v == 0.0
    with make_local_rig() as rig:
        rig.exchange(np.zeros(100))


def test_a_transient_fault_of_the_driver_loses_no_sample(
    stub_driver: StubDriver, rng: np.random.Generator
) -> None:
    stub_driver.plan(-200284, int(rng.integers(700, 2_000)))
    with make_local_rig() as rig:
        rig.arm()
        handed = [np.zeros(rig.info.lead_samples)]
        heard: list[np.ndarray[tuple[int, ...], np.dtype[np.float64]]] = []
        for _ in range(40):
            drive = rng.uniform(-75.0, 75.0, 100)
            try:
                got = rig.exchange(drive)
            except TransientError:
                got = rig.exchange(drive)
            handed.append(got.applied_v)
            heard.append(got.voltage_v)
        voltage = np.concatenate(heard)
        np.testing.assert_array_equal(voltage, np.concatenate(handed)[: voltage.size])
    assert stub_driver.output_v == 0.0


def test_closing_brings_the_output_to_zero(stub_driver: StubDriver) -> None:
    with make_local_rig() as rig:
        rig.arm()
        for _ in range(10):
            rig.exchange(np.full(100, 60.0))
        assert stub_driver.output_v != 0.0
    assert stub_driver.output_v == 0.0


def test_without_a_driver_the_error_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(nidaqmx._lib, "find_library", lambda _: None)
    forget_driver(monkeypatch)
    with pytest.raises(ConfigError, match="Install NI-DAQmx"):
        make_local_rig().open()
