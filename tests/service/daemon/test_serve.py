"""A real supervisor, a real rig process, a real router: who dies, and what the screen gets."""

import os
import queue
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pytest
from tests.patience import PATIENT_LEASE_MS
from tests.service.daemon.whole_service import TEXTURE, blocks_of, config_with, driven

import frictus
from frictus.keys import Topics
from frictus.messages import Counters
from frictus_hardware import SimulatedConfig
from frictus_hardware.simulated.strokes import SteadyStrokes
from frictus_laboratory.benchmarks.processes import await_status
from frictus_service.config import Config
from frictus_service.daemon.processes.supervisor import Supervisor

posix_signals = pytest.mark.skipif(
    sys.platform == "win32", reason="Windows has neither SIGSTOP nor SIGKILL for others"
)
LEASE_MS = 300
LIMIT_S = 0.1
"""From the moment the daemon can know to zero at the screen."""
CLIENT = f"""
import sys, time, frictus
with frictus.connect(sys.argv[1], name="doomed") as client:
    with client.rig("rig1").arm({LEASE_MS}) as lease:
        print("armed", flush=True)
        while not lease.lost:
            time.sleep(0.02)
        print("lost", flush=True)
"""

CROWD = """
import sys, time, frictus
with frictus.connect(sys.argv[1], name="doomed") as client:
    rig = client.rig("rig1")
    crowd = [rig.keys.client_alive(f"one{n}") for n in range(999)]
    tokens = [client.session.liveliness().declare_token(key) for key in crowd]
    with rig.arm(10_000):
        print("armed", flush=True)
        time.sleep(60.0)
"""


def last_driven_sample(block: frictus.Block) -> int:
    (places,) = np.nonzero(block.data[0])
    return block.first_sample + int(places[-1])


@dataclass(frozen=True)
class Service:
    config: Config
    supervisor: Supervisor
    said: "queue.Queue[str]"

    @property
    def endpoint(self) -> str:
        return self.config.router.endpoint

    def wait_for(self, words: str) -> None:
        """Wait until the supervisor has said something."""
        while words not in self.said.get(timeout=60.0):
            pass


@pytest.fixture(scope="module")
def service() -> Iterator[Service]:
    config = config_with(SimulatedConfig(finger=SteadyStrokes()))
    said: queue.Queue[str] = queue.Queue()
    with Supervisor(config, ("rig", "api"), say=said.put) as supervisor:
        supervisor.wait_ready(100.0)
        yield Service(config, supervisor, said)


@pytest.fixture
def observer(service: Service) -> Iterator[frictus.Rig]:
    with frictus.connect(service.endpoint, name="observer") as client:
        rig = client.rig("rig1")
        rig.set_scene(TEXTURE)
        yield rig


@pytest.fixture
def doomed(service: Service, observer: frictus.Rig) -> Iterator["subprocess.Popen[str]"]:
    """A client in a process of its own that holds the rig."""
    command = [sys.executable, "-c", CLIENT, service.endpoint]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline().strip() == "armed"
            await_status(observer, lambda status: status.owner == "doomed")
            yield process
        finally:
            process.kill()
    await_status(observer, lambda status: status.state == "disarmed")


def test_only_what_somebody_reads_is_published(service: Service, observer: frictus.Rig) -> None:
    def blocks_later(n_blocks: int) -> Counters:
        wanted = observer.status().counters.blocks + n_blocks
        return await_status(observer, lambda status: status.counters.blocks >= wanted).counters

    quiet = blocks_later(100)
    still = blocks_later(100)
    assert still.blocks >= quiet.blocks + 100
    assert still.blocks_published == quiet.blocks_published
    with observer.blocks("accel", timeout_s=10.0) as feed:
        sequence = [
            block.sequence for block, _ in zip(blocks_of(feed), range(100), strict=False)
        ]
        assert sequence == list(range(sequence[0], sequence[0] + 100))
        read = blocks_later(100)
    published = read.blocks_published - still.blocks_published
    # A block is handed over before it is counted.
    assert 100 <= published <= read.blocks + 1 - still.blocks, "one stream of all"


@posix_signals
@pytest.mark.parametrize("end", ["SIGKILL", "SIGSTOP"])
def test_output_is_zero_soon_after_its_client_ends(
    observer: frictus.Rig, doomed: "subprocess.Popen[str]", end: str
) -> None:
    with observer.blocks("voltage", timeout_s=10.0) as feed:
        blocks = blocks_of(feed)
        block = next(block for block in blocks if driven(block))
        ended_ns = time.time_ns()
        os.kill(doomed.pid, getattr(signal, end))
        armed, loud = block, block
        for block in blocks:
            if block.flags & frictus.Flag.ARMED:
                armed = block
            if driven(block):
                loud = block
            # Not a single sample more, for longer than any ramp.
            if block.first_sample > max(armed.first_sample, loud.first_sample) + 10_000:
                break
    rate_hz = block.sample_rate_hz
    known_sample = armed.first_sample + armed.data.shape[1]
    assert last_driven_sample(loud) <= known_sample + LIMIT_S * rate_hz
    silent_ns = loud.utc_ns + 1e9 * (last_driven_sample(loud) - loud.first_sample) / rate_hz
    allowed_ns = 1e6 * LEASE_MS + 1e9 * LIMIT_S + loud.uncertainty_ns
    assert silent_ns <= ended_ns + allowed_ns


def test_an_owner_that_dies_with_a_thousand_tokens_leaves_nothing_armed(
    service: Service, observer: frictus.Rig
) -> None:
    command = [sys.executable, "-c", CROWD, service.endpoint]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline().strip() == "armed"
            await_status(observer, lambda status: status.owner == "doomed")
        finally:
            process.kill()
        killed_s = time.monotonic()
    await_status(observer, lambda status: status.state == "disarmed")
    assert time.monotonic() - killed_s < 3.0, "far below the lease of 10 s"


@posix_signals
def test_frozen_client_wakes_to_a_lost_lease(
    observer: frictus.Rig, doomed: "subprocess.Popen[str]"
) -> None:
    os.kill(doomed.pid, signal.SIGSTOP)
    await_status(observer, lambda status: status.state == "disarmed")
    with observer.arm(PATIENT_LEASE_MS) as lease:
        os.kill(doomed.pid, signal.SIGCONT)
        # Whether its renewals are refused, or it reads first who holds the rig: it knows.
        assert doomed.stdout is not None
        assert doomed.stdout.readline().strip() == "lost"
        assert observer.status().owner == "observer"
        assert not lease.lost


def test_streamed_texture_is_felt_until_it_is_stale(observer: frictus.Rig) -> None:
    wave = 0.05 * np.sin(2.0 * np.pi * np.arange(64) / 64.0)
    with observer.arm(PATIENT_LEASE_MS), observer.open_stream(0.06) as stream:
        applied = stream.applied
        assert applied is not None
        stream.send(wave, period_mm=1.0, ttl_ms=300)
        stale = await_status(observer, lambda status: status.stream_stale)
        assert stale.stream_open
        assert stale.counters.stream_updates > 0
        with observer.blocks("truth", timeout_s=10.0) as feed:
            # After lead and fade what is felt is the bias alone: wherever the finger slides,
            # the mean over a cycle of the carrier's square (10 samples) stays the same. On a
            # busy machine a block comes after the status of a later moment, or is lost.
            faded_ns = stale.utc_ns + 60_000_000
            faded = (
                block
                for block in feed
                if isinstance(block, frictus.Block) and block.utc_ns > faded_ns
            )
            means = [
                block.data[4].reshape(-1, 10).mean(axis=1)
                for _, block in zip(range(40), faded, strict=False)
                if np.all(np.abs(block.data[2]) > 50.0)
            ]
            assert np.ptp(np.concatenate(means)) < 0.1 * 0.05
        stream.send(wave, period_mm=1.0, ttl_ms=300)
        await_status(observer, lambda status: status.stream_open and not status.stream_stale)


def test_what_is_rendered_and_what_is_true_are_read_as_one(observer: frictus.Rig) -> None:
    with (
        observer.arm(PATIENT_LEASE_MS),
        observer.blocks("truth", timeout_s=10.0) as truth,
        observer.blocks("render", timeout_s=10.0) as render,
        observer.blocks("voltage", timeout_s=10.0) as voltage,
    ):
        parts = frictus.align(truth=truth, render=render, voltage=voltage)
        taken = [part for number, part in zip(range(400), parts, strict=False) if number >= 200]
    assert sum(part.missing_samples for part in taken) < 2_000, "a busy machine may lose some"
    joined = {
        name: np.concatenate([part.data[name] for part in taken], axis=1)
        for name in ("truth", "render", "voltage")
    }
    assert len({samples.shape[1] for samples in joined.values()}) == 1
    apart_mm = joined["render"][0] - joined["truth"][0]
    assert np.sqrt(np.mean(np.square(apart_mm))) < 1.0
    drive = joined["render"][4]
    largest_v = np.sqrt(drive) * observer.status().screen_peak_v
    assert np.all(np.abs(joined["voltage"][0]) <= largest_v + 0.1)


@posix_signals
def test_api_that_freezes_and_ends_disturbs_nobody(
    service: Service, observer: frictus.Rig
) -> None:
    api = service.supervisor.pid_of("api")
    with (
        observer.arm(PATIENT_LEASE_MS) as lease,
        observer.blocks("voltage", timeout_s=10.0) as feed,
    ):
        blocks = blocks_of(feed)
        next(block for block in blocks if driven(block))
        # It is not watched for freezes: nothing on the screen hangs on it.
        for end in (signal.SIGSTOP, signal.SIGKILL):
            os.kill(api, end)
            later = [driven(next(blocks)) for _ in range(200)]
            assert later[-1]
            assert not lease.lost
    service.wait_for("api is ready")


def test_what_a_client_did_is_what_it_reads(service: Service, observer: frictus.Rig) -> None:
    for turn in range(25):
        scene = frictus.Scene(name=f"scene {turn}")
        etag = observer.set_scene(scene).etag
        state = observer.scene()
        assert (state.etag, state.scene.name) == (etag, scene.name)
        with observer.arm(PATIENT_LEASE_MS):
            assert observer.status().owner == "observer"
            if turn % 2:
                observer.stop()
                assert observer.status().state in ("stopping", "disarmed")
        status = observer.status()
        assert (status.owner, status.scene_etag) == (None, etag)


def test_a_loop_over_the_finger_ends_when_somebody_stops_the_rig(
    service: Service, observer: frictus.Rig
) -> None:
    with frictus.connect(service.endpoint, name="bystander") as client:
        with observer.arm(PATIENT_LEASE_MS), observer.open_stream(0.05) as stream:
            begun_ns = time.time_ns()

            def follow() -> None:
                for count, _ in enumerate(observer.fingers(timeout_s=10.0)):
                    stream.send([0.02, -0.02], period_mm=1.0)
                    if count == 20:
                        client.rig("rig1").stop()

            with pytest.raises(frictus.LeaseLostError, match="stopped by 'bystander'") as lost:
                follow()
            assert lost.value.by == "bystander"
            assert lost.value.utc_ns is not None
            assert begun_ns < lost.value.utc_ns < time.time_ns()
            with pytest.raises(frictus.LeaseLostError, match="bystander"):
                stream.send([0.02, -0.02], period_mm=1.0)


def test_two_clients_cannot_hold_one_rig(service: Service, observer: frictus.Rig) -> None:
    with frictus.connect(service.endpoint, name="other") as client:
        other = client.rig("rig1")
        with observer.arm(PATIENT_LEASE_MS):
            with pytest.raises(frictus.RefusedError, match="observer") as refused:
                other.arm()
            assert refused.value.code == "not_owner"
            with pytest.raises(frictus.RefusedError):
                other.set_scene(TEXTURE)
            other.stop()
            await_status(observer, lambda status: status.state == "disarmed")


def test_garbage_on_every_key_leaves_the_rig_alive(
    service: Service, observer: frictus.Rig, rng: np.random.Generator
) -> None:
    with frictus.session.open_session(service.endpoint) as session:
        keys = service.config.keys
        with observer.blocks("force", timeout_s=10.0) as feed:
            blocks = blocks_of(feed)
            next(blocks)
            refused = observer.status().counters.refused_commands
            for topic in (Topics.TEXTURE, Topics.LEASE, Topics.POINTER):
                for size in (0, 1, 63, 64, 300_000):
                    session.put(keys.of(topic), rng.bytes(size))
            for call in ("arm", "scene", "model", "open_stream", "reset"):
                answers = session.get(keys.call(call), payload=rng.bytes(50), timeout=5.0)
                for answer in answers:
                    assert answer.ok is not None
                    assert b"bad_request" in answer.ok.payload.to_bytes()
            await_status(
                observer, lambda status: status.counters.refused_commands >= refused + 5
            )
            for _ in range(50):
                next(blocks)
        assert observer.status().state == "disarmed"
