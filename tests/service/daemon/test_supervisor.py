"""What a supervisor does where a part of the service dies, freezes or cannot start."""

import errno
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.patience import PATIENT_LEASE_MS
from tests.service.daemon.whole_service import TEXTURE, blocks_of, config_with, driven

import frictus
from frictus.keys import Topics
from frictus_hardware import SimulatedConfig, SimulatedDeviceConfig
from frictus_hardware.simulated.device_rig import launched, recent_output
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_laboratory.benchmarks.processes import await_status
from frictus_service.config import Limits
from frictus_service.daemon.processes.supervisor import Supervisor
from frictus_service.errors import StartError
from frictus_service.processes import free_endpoint

posix_signals = pytest.mark.skipif(
    sys.platform == "win32", reason="Windows has neither SIGSTOP nor SIGKILL for others"
)


@pytest.fixture
def device() -> Iterator[SimulatedDeviceConfig]:
    """A device in a process of its own, which holds its last value."""
    with launched(SimulatedConfig(finger=SteadyStrokes())) as config:
        yield config


@posix_signals
def test_rig_that_dies_or_freezes_is_reset_and_started_again(
    device: SimulatedDeviceConfig,
) -> None:
    config = config_with(device)
    said: list[str] = []
    with (
        Supervisor(config, ("rig",), say=said.append) as supervisor,
        frictus.connect(config.router.endpoint) as client,
    ):
        supervisor.wait_ready(100.0)
        rig = client.rig("rig1")
        for end, words in ((signal.SIGSTOP, "stood still"), (signal.SIGKILL, "signal 9")):
            run = await_status(rig, lambda status: status.state == "disarmed").run
            rig.set_scene(TEXTURE)
            lease = rig.arm(PATIENT_LEASE_MS)
            with rig.blocks("voltage", timeout_s=10.0) as feed:
                next(b for b in feed if isinstance(b, frictus.Block) and driven(b))
            with rig.watch(Topics.STATUS, timeout_s=60.0) as states:
                os.kill(supervisor.pid_of("rig"), end)
                told: Any = next(state for state in states if state.state == "tripped")  # type: ignore[attr-defined]
                output = recent_output(device, 1.0)
                assert words in told.fault.reason
                assert "the device was reset" in told.fault.reason
                assert not output.holding
                assert not output.armed
                assert output.voltage_v[-1] == 0.0
                if end == signal.SIGSTOP:
                    assert _held_samples(output.voltage_v) > 1_000, "it held its last value"
                again: Any = next(s for s in states if s.run != run)  # type: ignore[attr-defined]
            assert again.state == "disarmed"
            assert again.fault is not None
            assert words in again.fault.reason
            assert lease.wait_lost(10.0)
            lease.disarm()
    assert any("started again" in line for line in said)
    assert said[-1] == "stopped"


@posix_signals
def test_a_rig_is_watched_although_nobody_can_be_told_and_whatever_fails_once(
    device: SimulatedDeviceConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Who reads standard error may be gone, its disk full; a process may not start."""
    config = config_with(device)

    def say(_line: str) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with (
        Supervisor(config, ("rig",), say=say) as supervisor,
        frictus.connect(config.router.endpoint) as client,
    ):
        supervisor.wait_ready(100.0)
        rig = client.rig("rig1")
        run = rig.status().run
        context = supervisor._context
        failures: list[str] = []
        follow, process = supervisor._follow, context.Process

        def failing(look_s: float) -> None:
            follow(look_s)
            if not failures:
                failures.append("follow")
                raise ZeroDivisionError

        def unstarted(**given: Any) -> Any:
            made = process(**given)
            if "start" not in failures:
                failures.append("start")
                monkeypatch.setattr(made, "start", lambda: os.open("/nowhere", os.O_RDONLY))
            return made

        monkeypatch.setattr(supervisor, "_follow", failing)
        monkeypatch.setattr(context, "Process", unstarted)
        with rig.watch(Topics.STATUS, timeout_s=60.0) as states:
            os.kill(supervisor.pid_of("rig"), signal.SIGSTOP)
            told: Any = next(state for state in states if state.state == "tripped")  # type: ignore[attr-defined]
            assert "the device was reset" in told.fault.reason
            again: Any = next(s for s in states if s.run != run)  # type: ignore[attr-defined]
        assert again.state == "disarmed"
        assert failures == ["follow", "start"]


def _held_samples(voltage_v: Any) -> int:
    """Return the longest run of one value other than zero."""
    same = (np.diff(voltage_v) == 0.0) & (voltage_v[1:] != 0.0)
    longest = run = 0
    for held in same:
        run = run + 1 if held else 0
        longest = max(longest, run)
    return longest


def test_part_that_cannot_start_says_why(tmp_path: Path) -> None:
    config = config_with(SimulatedConfig()).model_copy(
        update={"model_file": tmp_path / "absent.json"}
    )
    with (
        Supervisor(config, ("rig",), say=lambda _line: None) as supervisor,
        pytest.raises(StartError, match=r"absent\.json"),
    ):
        supervisor.wait_ready(60.0)


@pytest.fixture
def served(tmp_path: Path) -> Iterator["subprocess.Popen[str]"]:
    """`serve` in a process group of its own, as a terminal starts it; ready."""
    path = tmp_path / "frictus.toml"
    path.write_text(f'[router]\nendpoint = "{free_endpoint()}"\n', encoding="utf-8")
    code = (
        "import sys; from pathlib import Path; from frictus_service.config_file import load;"
        "from frictus_service.daemon.processes.serve import serve;"
        "serve(load(Path(sys.argv[1])), ('rig',))"
    )
    new_process_group = 0x200 if sys.platform == "win32" else 0
    process = subprocess.Popen(
        [sys.executable, "-c", code, str(path)],
        stderr=subprocess.PIPE,
        text=True,
        creationflags=new_process_group,
        start_new_session=sys.platform != "win32",
    )
    with process:
        try:
            assert process.stderr is not None
            said = iter(process.stderr)
            assert any(line.startswith("ready") for line in said)
            yield process
        finally:
            process.kill()


def test_interrupt_stops_everything(served: "subprocess.Popen[str]") -> None:
    assert served.stderr is not None
    # As a terminal does: every process of the group gets it.
    if sys.platform == "win32":
        served.send_signal(signal.CTRL_BREAK_EVENT)
    else:
        os.killpg(served.pid, signal.SIGINT)
    rest = served.stderr.read()  # ends when the last process has closed it
    assert served.wait(30.0) == 0, rest
    assert rest.splitlines()[-1] == "stopped"
    assert "Traceback" not in rest
    assert "killed" not in rest


@posix_signals
def test_parts_do_not_outlive_their_supervisor(served: "subprocess.Popen[str]") -> None:
    assert served.stderr is not None
    served.kill()
    rest = served.stderr.read()
    assert "Traceback" not in rest


def test_a_slow_clock_trips_nothing_and_keeps_utc() -> None:
    backend = SimulatedConfig(finger=SteadyStrokes(), clock=0.25)
    config = config_with(backend).model_copy(update={"limits": Limits(freeze_ms=500)})
    with (
        Supervisor(config, ("rig",), say=lambda _line: None) as supervisor,
        frictus.connect(config.router.endpoint, name="patient") as client,
    ):
        supervisor.wait_ready(100.0)
        rig = client.rig("rig1")
        with rig.arm(PATIENT_LEASE_MS):
            begun = rig.status().counters.blocks
            # Of blocks that each last four times as long, the limit is reached by half.
            enough = begun + 2 * config.limits.missed_deadlines
            status = await_status(rig, lambda status: status.counters.blocks >= enough)
            assert status.state == "armed", status.fault
            with rig.blocks("voltage", timeout_s=10.0) as feed:
                block = next(blocks_of(feed))
            behind_s = 1e-9 * (time.time_ns() - block.utc_ns)
        assert 0.0 <= behind_s < 0.5, "by nominal rate it would be over a second by now"
        with rig.watch(Topics.TIME, timeout_s=10.0) as states:
            state = next(iter(states))
        assert isinstance(state, frictus.TimeState)
        assert abs(state.skew_ppm) <= 200.0
