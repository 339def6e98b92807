"""A recording becomes a tape, and the tape plays as it was, down to the drive it leads to."""

import json
import re
import threading
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from typer.testing import CliRunner

from frictus.keys import Topics
from frictus.messages import RigStatus
from frictus.textures import Component, Region, Scene, Spectrum
from frictus_hardware import ReplayConfig, SimulatedConfig
from frictus_hardware.base import Backend, RigInfo
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.replay.rig import ReplayRig
from frictus_hardware.replay.tape import Tape, read_tape
from frictus_hardware.simulated.clock import VirtualClock
from frictus_hardware.simulated.rig import SimulatedRig
from frictus_service.cli.app import app
from frictus_service.cli.options import Exit
from frictus_service.config import Config
from frictus_service.config_file import parse
from frictus_service.daemon.block_loop.block_record import (
    BlockRecord,
    blocks_of,
    flags_of,
    touch_of,
)
from frictus_service.daemon.block_loop.lead import RetryingBackend
from frictus_service.daemon.block_loop.loop import BlockLoop
from frictus_service.daemon.block_loop.timebase import Stamp
from frictus_service.daemon.control import Interlock
from frictus_service.daemon.inboxes import LoopInbox, ModelSlot, SceneUpdate
from frictus_service.daemon.model_controller import rendered_model
from frictus_service.daemon.safety import Arm
from frictus_service.errors import ExportError, NotWrittenError
from frictus_service.recording.records import RecordingInfo
from frictus_service.recording.tape import Taped, export_tape
from frictus_service.recording.writer import RecordingWriter
from frictus_service.synthesis.compensability import placeholder_model, screen_of
from frictus_service.synthesis.scene import compile_scene

RATE_HZ, BLOCK = 20_000.0, 100
UTC_NS = 1_795_000_000_000_000_000
RUN = 7
ARMED_AFTER = 100
"""Turns; 0.5 s."""
TEXTURE = Scene(
    regions=[
        Region(
            texture=Spectrum(
                components=[
                    Component(amplitude_n=0.05, cycles_per_mm=2.0),
                    Component(amplitude_n=0.02, hz=90.0),
                ]
            )
        )
    ]
)


@dataclass
class Heartbeat:
    value: int = 0


class Stop(threading.Event):
    """Lets no time pass, and is set once it has been waited for so often."""

    def __init__(self, waits: int) -> None:
        super().__init__()
        self._waits = waits

    def wait(self, timeout: float | None = None) -> bool:
        self._waits -= 1
        if self._waits <= 0:
            self.set()
        return self.is_set()


def loop_of(backend: Backend, clock: VirtualClock, config: Config) -> BlockLoop:
    def monotonic_ns() -> int:
        return round(clock.sample() * 1e9 / RATE_HZ)

    orders = LoopInbox(ModelSlot(rendered_model(placeholder_model(), screen_of(backend.info))))
    scene = compile_scene(TEXTURE, FrictionLaw(), screen_of(backend.info), RATE_HZ)
    orders.scene.append(SceneUpdate(scene))
    return BlockLoop(
        RetryingBackend(backend, monotonic_ns),
        config,
        Interlock(),
        orders,
        Heartbeat(),
        RUN,
        monotonic_ns,
        lambda: UTC_NS + monotonic_ns(),
    )


def turned(loop: BlockLoop, turns: int, armed_after: int = ARMED_AFTER) -> list[BlockRecord]:
    """Turn the loop so often, armed on the way, and return what it handed over."""
    taken = []
    for number in range(turns):
        if number == armed_after:
            loop._interlock.feed(Arm("ann", 10.0), loop._now_s())
        loop.turn()
        while not loop.handover.empty():
            taken.append(loop.handover.get())
    return taken


def live(seed: int, turns: int, **changes: object) -> tuple[list[BlockRecord], RigInfo]:
    """Run a simulated rig and return all of it."""
    clock = VirtualClock()
    config = SimulatedConfig.model_validate({"clock": "virtual", "seed": seed} | changes)
    with SimulatedRig(config, clock) as rig:
        return turned(loop_of(rig, clock, Config(backend=config)), turns), rig.info


def replayed(
    tape: Tape, turns: int, armed_after: int = ARMED_AFTER, **changes: object
) -> tuple[list[BlockRecord], BlockLoop]:
    """Run the same on a tape."""
    clock = VirtualClock()
    config = ReplayConfig.model_validate({"file": Path("tape.npz")} | changes)
    rig = ReplayRig(config, tape, clock)
    rig.open()
    loop = loop_of(rig, clock, Config(backend=config))
    return turned(loop, turns, armed_after), loop


def status_of(info: RigInfo, **changes: object) -> RigStatus:
    told: dict[str, Any] = {
        "site": "lab",
        "rig": "rig1",
        "version": "0",
        "run": RUN,
        "utc_ns": UTC_NS,
        "state": "disarmed",
        "backend": info.backend,
        "simulated": info.simulated,
        "finger_source": info.finger_source,
        "sample_rate_hz": info.sample_rate_hz,
        "block_samples": BLOCK,
        "lead_ms": 1e3 * info.lead_samples / info.sample_rate_hz,
        "screen_mm": info.screen_mm,
        "screen_peak_v": info.screen_peak_v,
        "touch_latency_s": info.touch_latency_s,
        "model_etag": "m",
        "model_placeholder": True,
        "scene_etag": "s",
    }
    return RigStatus.model_validate(told | changes)


def record(path: Path, turns: Iterable[BlockRecord], info: RigInfo, status: RigStatus) -> Path:
    """Record what a rig publishes of these turns."""
    about = RecordingInfo(
        name="known",
        site="lab",
        rig="rig1",
        started_utc_ns=UTC_NS,
        software="frictus test",
        converter_steps=dict(info.converter_steps),
    )
    attached = {"status.json": status.to_json()}
    with RecordingWriter(path, about, attached, lambda: 0.0) as writer:
        for turn in turns:
            since_s = turn.run - RUN + turn.exchange.first_sample / RATE_HZ
            at_ns = UTC_NS + round(1e9 * since_s)
            flags = flags_of(turn, info, True)
            for block in blocks_of(turn, Stamp(at_ns, 1_000), flags, RATE_HZ):
                writer.block(block)
            for report in turn.exchange.touches:
                touch = touch_of(report, turn.run, info)
                assert touch is not None
                writer.state(Topics.TOUCH, touch.to_json(), at_ns)
        writer.end("asked for", UTC_NS)
    return path


Make = Callable[..., tuple[Tape, Taped]]


@pytest.fixture
def taped(tmp_path: Path) -> Make:
    """Record turns, export the recording, and read the tape."""

    def make(turns: list[BlockRecord], info: RigInfo, **arguments: Any) -> tuple[Tape, Taped]:
        recording = record(tmp_path / "known.mcap", turns, info, status_of(info))
        done = export_tape(recording, tmp_path / "known.npz", **arguments)
        return read_tape(tmp_path / "known.npz"), done

    return make


def joined(turns: list[BlockRecord], name: str) -> NDArray[np.float64]:
    return np.concatenate([getattr(turn.exchange, name) for turn in turns])


def assert_same_senses(now: list[BlockRecord], then: list[BlockRecord]) -> None:
    for one, other in zip(now, then, strict=True):
        mine, theirs = one.exchange, other.exchange
        assert mine.first_sample == theirs.first_sample
        np.testing.assert_array_equal(mine.force_n, theirs.force_n)
        np.testing.assert_array_equal(mine.accel_m_s2, theirs.accel_m_s2)
        assert mine.touches == theirs.touches


def test_what_is_driven_now_is_what_was_driven_then(
    taped: Make, rng: np.random.Generator
) -> None:
    turns = 220
    then, info = live(int(rng.integers(1 << 31)), turns)
    tape, done = taped(then, info)
    assert (done.seconds, done.missing) == (turns * BLOCK / RATE_HZ, 0)
    assert done.ending.complete
    now, loop = replayed(tape, turns)
    assert_same_senses(now, then)
    assert np.any(joined(then, "applied_v")), "something was driven"
    assert [turn.finger for turn in now] == [turn.finger for turn in then]
    for name in ("applied_v", "voltage_v"):
        np.testing.assert_array_equal(joined(now, name), joined(then, name))
    rig = loop._backend.inner  # type: ignore[attr-defined]
    monitored = joined(now, "voltage_v").astype(np.float32)
    np.testing.assert_array_equal(rig.voltage_then(0, monitored.size), monitored)
    assert loop._interlock.state.state == "armed"


def test_counts_stay_counts_and_values_values(taped: Make) -> None:
    then, info = live(1, 40)
    tape, _ = taped(then, info)
    assert {tape.force.dtype.name, tape.accel.dtype.name} == {"int16"}
    assert tape.force_step_n == info.converter_steps["force"]
    assert ReplayRig(ReplayConfig(file=Path("x")), tape).info.converter_steps == (
        info.converter_steps
    )


def test_samples_of_no_converter_are_kept_to_float32(taped: Make) -> None:
    then, info = live(2, 40, quantisation=False)
    tape, _ = taped(then, info)
    assert (tape.force.dtype.name, tape.force_step_n) == ("float32", 1.0)
    np.testing.assert_array_equal(tape.force, joined(then, "force_n").astype(np.float32))


def test_a_recording_begun_later_leads_to_the_same_drive_after_a_while(
    taped: Make, rng: np.random.Generator
) -> None:
    then, info = live(int(rng.integers(1 << 31)), 1_200)
    then = then[61:]
    tape, _ = taped(then, info)
    assert tape.first_sample == 6_100, "carrier and textures keep their phase"
    now, _ = replayed(tape, len(then), armed_after=ARMED_AFTER - 61)
    assert_same_senses(now, then)
    later = slice(-100, None)  # 5.2 s after its beginning
    # The fit of the skin and the estimate of gravity remember longer than that, a little.
    np.testing.assert_allclose(
        joined(now[later], "applied_v"), joined(then[later], "applied_v"), atol=0.02
    )


def test_part_of_a_recording(taped: Make) -> None:
    then, info = live(3, 100)
    tape, done = taped(then, info, from_s=0.1, to_s=0.3)
    assert done.seconds == 0.2
    assert (tape.first_sample, tape.end_sample) == (2_000, 6_000)
    np.testing.assert_array_equal(
        tape.force * tape.force_step_n, joined(then, "force_n")[2_000:6_000]
    )


def test_lost_blocks_play_as_overruns_and_the_end_parks_the_loop(taped: Make) -> None:
    then, info = live(4, 200)
    kept = then[:50] + then[53:120] + then[121:]
    tape, done = taped(kept, info)
    assert done.missing == 4 * BLOCK
    now, loop = replayed(tape, 196)
    for one, other in zip(now, kept, strict=True):
        assert one.exchange.first_sample == other.exchange.first_sample
        np.testing.assert_array_equal(one.exchange.force_n, other.exchange.force_n)
    told = {n: turn.exchange.overrun_samples for n, turn in enumerate(now)}
    assert {n: lost for n, lost in told.items() if lost} == {50: 300, 117: 100}
    assert loop.tally.overruns == 2
    assert loop._interlock.trips == 0

    loop.turn()
    kind, reason = loop._interlock.state.fault or ("", "")
    assert (kind, loop.parked) == ("device_lost", True)
    assert "'known' is over, after 1.00 s" in reason
    loop.wait_for_device(Stop(5))
    assert (loop.parked, loop.run) == (True, RUN), "a recording that is over does not come back"


def test_a_looped_tape_goes_on(taped: Make) -> None:
    then, info = live(5, 60)
    tape, _ = taped(then, info)
    now, loop = replayed(tape, 180, at_end="loop")
    assert len(now) == 180
    assert loop.tally.overruns == 2
    assert loop._interlock.trips == 0
    for lap in range(3):
        part = now[60 * lap : 60 * (lap + 1)]
        np.testing.assert_array_equal(joined(part, "force_n"), joined(then, "force_n"))


def test_the_latency_of_an_old_recording_has_to_be_said(tmp_path: Path) -> None:
    then, info = live(6, 40)
    path = record(tmp_path / "old.mcap", then, info, status_of(info, touch_latency_s=None))
    out = tmp_path / "old.npz"
    with pytest.raises(ExportError, match="--touch-latency"):
        export_tape(path, out)
    assert not out.exists()
    export_tape(path, out, touch_latency_s=0.02)
    assert read_tape(out).touch_latency_s == 0.02
    with pytest.raises(NotWrittenError, match="already"):
        export_tape(path, out, touch_latency_s=0.02)


def test_several_runs_have_to_be_cut(taped: Make) -> None:
    then, info = live(7, 40)
    again = [
        BlockRecord(
            RUN + 1, turn.number, *(getattr(turn, name) for name in BlockRecord.__slots__[2:])
        )
        for turn in then
    ]
    with pytest.raises(ExportError, match="started anew"):
        taped(then + again, info)


def test_the_example_of_the_documentation_loads() -> None:
    text = (Path(__file__).parents[3] / "docs" / "replay.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"```toml\n(.*?)```", text, re.DOTALL)
    backend = parse(example, Path("rigs") / "replay.toml").backend
    assert isinstance(backend, ReplayConfig)
    assert (backend.file, backend.at_end) == (Path("rigs/recordings/pilot.npz"), "loop")


def test_command(tmp_path: Path) -> None:
    then, info = live(8, 40)
    path = record(tmp_path / "pilot.mcap", then, info, status_of(info))
    run = CliRunner()
    done = run.invoke(app, ["export", str(path), "--to", "replay", "--json"])
    assert done.exit_code == Exit.OK, done.output
    told = json.loads(done.output)
    assert (told["seconds"], told["missing_samples"]) == (0.2, 0)
    assert read_tape(Path(told["out"])).name == "known"
    again = run.invoke(app, ["export", str(path), "--to", "replay"])
    assert again.exit_code == Exit.USAGE
