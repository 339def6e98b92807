"""A device that outlives its client holds its last value until it is reset."""

import socket
import subprocess
import sys
import threading
from multiprocessing.connection import Connection
from typing import Any

import numpy as np
import pytest

from frictus_hardware import SimulatedConfig, SimulatedDeviceConfig
from frictus_hardware.errors import ConfigError, DeviceLostError, LinkLostError
from frictus_hardware.simulated.device_rig import SimulatedDeviceRig, recent_output
from frictus_hardware.simulated.guided import ClientFinger

DYING_CLIENT = """
import os, sys
import numpy as np
from frictus_hardware import SimulatedConfig, SimulatedDeviceConfig
rig = SimulatedConfig(lead_ms=800.0)  # what is late on a busy machine is never held
backend = SimulatedDeviceConfig(address=sys.argv[1], rig=rig).make()
backend.open()
backend.arm()
for _ in range(10):
    backend.exchange(np.full(100, 40.0))
os._exit(9)
"""


@pytest.fixture
def config(device_address: str) -> SimulatedDeviceConfig:
    return SimulatedDeviceConfig(address=device_address, rig=SimulatedConfig(lead_ms=200.0))


def test_holds_its_last_value_when_its_client_dies_until_reset(
    config: SimulatedDeviceConfig,
) -> None:
    died = subprocess.run([sys.executable, "-c", DYING_CLIENT, config.address], check=False)
    assert died.returncode == 9
    while not (output := recent_output(config, 0.01)).holding:
        pass  # what is queued plays first
    assert output.armed
    assert np.all(recent_output(config, 0.001).voltage_v == 40.0)
    config.reset()
    output = recent_output(config, 5.0)
    assert not output.holding
    assert not output.armed
    assert output.voltage_v[-1] == 0.0
    last = np.flatnonzero(output.voltage_v)[-1]
    assert output.voltage_v[last] == 40.0  # zero at once, from the held value
    with SimulatedDeviceRig(config) as rig:
        assert rig.exchange(np.zeros(400)).first_sample == 0
        before = recent_output(config, 5.0)
        assert before.first_sample < 0
        assert np.any(before.voltage_v == 40.0)  # it remembers


def test_whoever_drives_it_loses_it_on_reset(config: SimulatedDeviceConfig) -> None:
    with SimulatedDeviceRig(config) as rig:
        rig.arm()
        rig.exchange(np.full(100, 40.0))
        config.reset()
        for call in (lambda: rig.exchange(np.full(100, 40.0)), rig.arm):
            with pytest.raises(DeviceLostError, match="reset"):
                call()
        with SimulatedDeviceRig(config) as other:
            other.exchange(np.zeros(100))
            rig.close()  # of no concern to the other
            other.exchange(np.zeros(100))


def test_has_one_owner(config: SimulatedDeviceConfig) -> None:
    with (
        SimulatedDeviceRig(config),
        pytest.raises(ConfigError, match="another client"),
        SimulatedDeviceRig(config),
    ):
        pass


def test_output_falls_to_zero_after_a_stop_and_is_not_held(
    config: SimulatedDeviceConfig,
) -> None:
    with SimulatedDeviceRig(config) as rig:
        rig.arm()
        rig.exchange(np.full(3_000, 40.0))
        rig.exchange(np.full(3_000, 40.0))
        rig.stop(0.01)
        rig.exchange(np.zeros(600))
        output = recent_output(config, 0.01)
        assert output.voltage_v[-1] == 0.0
        assert not output.holding


def test_a_client_moves_its_finger(device_address: str) -> None:
    config = SimulatedDeviceConfig(
        address=device_address, rig=SimulatedConfig(finger=ClientFinger())
    )
    with SimulatedDeviceRig(config) as rig:
        rig.move_finger(20.0, 10.0, in_contact=True)
        got = rig.exchange(np.zeros(3_000))
        assert any(report.in_contact for report in got.touches)


def test_a_virtual_clock_is_refused(device_address: str) -> None:
    config = SimulatedDeviceConfig(address=device_address, rig=SimulatedConfig(clock="virtual"))
    with pytest.raises(ConfigError, match="virtual"), SimulatedDeviceRig(config):
        pass


def test_a_wrong_authkey_is_refused_and_harms_nobody(config: SimulatedDeviceConfig) -> None:
    stranger = config.model_copy(update={"authkey": "something else"})
    with pytest.raises(ConfigError, match="authkey"):
        recent_output(stranger, 1.0)
    recent_output(config, 1.0)


def test_no_device_is_a_lost_link(unused_address: str) -> None:
    config = SimulatedDeviceConfig(address=unused_address)
    for call in (SimulatedDeviceRig(config).open, config.reset):
        with pytest.raises(LinkLostError, match="start one"):
            call()


def test_a_frozen_device_is_a_lost_link() -> None:
    with socket.create_server(("127.0.0.1", 0)) as frozen:
        address = "{}:{}".format(*frozen.getsockname())
        config = SimulatedDeviceConfig(address=address, timeout_s=0.05)
        with pytest.raises(LinkLostError, match="frozen"):
            config.reset()


def test_a_device_that_freezes_in_the_handshake_is_a_lost_link() -> None:
    def challenge() -> None:
        held.append(Connection(listener.accept()[0].detach()))
        held[0].send_bytes(b"#CHALLENGE#" + bytes(20))

    held: list[Connection[Any, Any]] = []
    with socket.create_server(("127.0.0.1", 0)) as listener:
        thread = threading.Thread(target=challenge)
        thread.start()
        address = "{}:{}".format(*listener.getsockname())
        with pytest.raises(LinkLostError, match="frozen"):
            SimulatedDeviceConfig(address=address, timeout_s=0.5).reset()
        thread.join()
    held[0].close()


def test_a_client_that_freezes_in_the_handshake_keeps_nobody_out(
    config: SimulatedDeviceConfig,
) -> None:
    with socket.create_connection(config.endpoint):
        recent_output(config, 1.0)


def test_a_device_that_dies_is_a_lost_link() -> None:
    command = [sys.executable, "-m", "frictus_hardware.simulated.device"]
    with subprocess.Popen(
        [*command, "--address", "127.0.0.1:0"], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        config = SimulatedDeviceConfig(address=process.stdout.readline().strip())
        rig = SimulatedDeviceRig(config)
        rig.open()
        rig.exchange(np.zeros(100))
        process.kill()
        process.wait()
        with pytest.raises(LinkLostError, match="gone"):
            rig.exchange(np.zeros(100))
        health = rig.health()
        assert health is not None
        assert "gone" in health
        rig.close()
