"""The C client: it plays and reads at a real rig, and no service can break it."""

import contextlib
import json
import os
import re
import shutil
import socket
import struct
import subprocess
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from urllib.request import Request, urlopen

import numpy as np
import pytest
from tests.service.dashboard.page import (
    SECRETS,
    configuration,
    rig_that_follows_pages,
    serving,
)

from frictus.stream import StreamFrame
from frictus.websocket.frames import Frame, Kind

pytestmark = pytest.mark.timeout(300)
SOURCE = Path(__file__).parents[2] / "clients" / "c"
WARNINGS = ("-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Werror")
CHECKED = (
    "-std=c99",
    "-g",
    "-O1",
    "-fsanitize=address,undefined,float-cast-overflow",
    "-fno-sanitize-recover=all",
)
COMMA = """\
LC_NUMERIC
decimal_point ","
thousands_sep ""
grouping -1
END LC_NUMERIC
"""
WELCOME = {"op": "welcome", "protocol": "1.1", "client": "x.page-1", "utc_us": 1.7e15}


def compiled(
    folder: Path, compiler: str, *options: str, source: Path = SOURCE / "example.c"
) -> Path:
    if shutil.which(compiler) is None:
        pytest.skip(f"there is no {compiler} here: `apt-get install gcc g++` brings it")
    program = folder / f"{source.stem}-{compiler}"
    command = [compiler, *options, *WARNINGS, f"-I{SOURCE}", str(source)]
    command += ["-lm", "-o", str(program)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60.0)
    assert done.returncode == 0, done.stderr
    return program


@pytest.fixture(scope="module")
def example(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The example, with a look at every access to memory."""
    return compiled(tmp_path_factory.mktemp("c"), "gcc", *CHECKED)


@pytest.fixture(scope="module")
def port(example: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    """A rig, and the API beside it."""
    with rig_that_follows_pages() as router:
        with serving(configuration(router, tmp_path_factory.mktemp("api"), True)) as port:
            yield port


def run(
    example: Path, port: int, *, seconds: float, token: str | None
) -> subprocess.CompletedProcess[str]:
    env = dict(os.environ) | ({} if token is None else {"FRICTUS_TOKEN": token})
    command = [str(example), "127.0.0.1", str(port), "rig1", f"{seconds:g}"]
    return subprocess.run(
        command, env=env, capture_output=True, text=True, errors="replace", timeout=60.0
    )


def test_it_is_cpp_too(tmp_path: Path) -> None:
    compiled(tmp_path, "g++", "-x", "c++")


def test_the_example_plays_and_loses_nothing(example: Path, port: int) -> None:
    done = run(example, port, seconds=3.0, token=SECRETS["render"])
    assert done.returncode == 0, done.stderr
    found = re.match(
        r"samples (\d+) lost (\d+) states (\d+) finger .* mm\n"
        r"updates (\d+) passed on (\d+)\n",
        done.stdout,
    )
    assert found, done.stdout
    samples, lost, states, updates, passed_on = map(int, found.groups())
    assert samples + lost > 2 * 20_000
    assert lost == 0
    assert states > 200
    assert 50 < passed_on <= updates


def test_who_streams_to_a_rig_that_was_stopped_is_told(example: Path, port: int) -> None:
    env = dict(os.environ) | {"FRICTUS_TOKEN": SECRETS["render"]}
    command = [str(example), "127.0.0.1", str(port), "rig1", "30"]
    begun_s = time.monotonic()
    with subprocess.Popen(command, env=env, stderr=subprocess.PIPE, text=True) as playing:
        time.sleep(2.0)
        stopped = Request(
            f"http://127.0.0.1:{port}/v1/rigs/rig1/stop",
            method="POST",
            headers={"Authorization": f"Bearer {SECRETS['read']}"},
        )
        urlopen(stopped, timeout=10.0).close()
        _, told = playing.communicate(timeout=25.0)
    assert playing.returncode == 1
    assert "the stream has ended: the rig is" in told  # who stopped it, or that it was late
    assert time.monotonic() - begun_s < 20.0


@pytest.mark.parametrize(
    ("token", "why"), [(None, "asks for a token"), ("x" * 20, "not known")]
)
def test_who_is_refused_is_told_why(
    example: Path, port: int, token: str | None, why: str
) -> None:
    done = run(example, port, seconds=1.0, token=token)
    assert done.returncode == 1
    assert "refused: " in done.stderr
    assert why in done.stderr


def test_nobody_there_is_said(example: Path) -> None:
    done = run(example, 1, seconds=1.0, token=None)
    assert (done.returncode, done.stderr) == (1, "nobody listens at 127.0.0.1\n")


def frame(opcode: int, payload: bytes, flags: int = 0x80) -> bytes:
    size = len(payload)
    head = bytes([flags | opcode])
    if size < 126:
        return head + bytes([size]) + payload
    if size < 65_536:
        return head + struct.pack(">BH", 126, size) + payload
    return head + struct.pack(">BQ", 127, size) + payload


def told(**fields: object) -> bytes:
    return frame(1, json.dumps(fields, separators=(",", ":")).encode())


def answered_by(example: Path, *answers: bytes) -> subprocess.CompletedProcess[str]:
    """Run the example at a service that answers it with bytes, then closes."""
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def serve() -> None:
            connection, _ = listener.accept()
            with connection, contextlib.suppress(OSError):  # it may leave before the end
                connection.recv(4_096)
                connection.sendall(b"".join(answers))
                connection.shutdown(socket.SHUT_WR)
                while connection.recv(65_536):
                    pass

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        done = run(example, listener.getsockname()[1], seconds=0.2, token=None)
        thread.join(10.0)
        return done


SHAKEN = b"HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\n\r\n"
GREETED = SHAKEN + told(**WELCOME)
SAMPLES = Frame(1, 0, 3, 400, 0, 2e4, 1, Kind.RAW, 0, np.zeros((3, 100), np.float32)).pack()
FINGER = Frame(100, 0, 3, 400, 0, 2e4, 1, Kind.FINGER, 0, np.ones((8, 3), np.float32)).pack()
NAN = struct.pack("<f", np.nan)
GOOD = [
    told(op="armed", rig="rig1", id=1),
    told(op="stream_opened", rig="rig1", ticket=1, applied=None, id=2),
    frame(9, b"are you there?"),
    frame(2, SAMPLES),
    frame(2, FINGER),
]


def faultless(done: subprocess.CompletedProcess[str]) -> None:
    """Fail if the program did anything but end with a reason."""
    assert done.returncode in (0, 1), done.stderr
    assert "Sanitizer" not in done.stderr
    assert "runtime error" not in done.stderr


@pytest.mark.parametrize(
    ("answers", "why"),
    [
        ([b"HTTP/1.1 403 Forbidden\r\n\r\n"], "403"),
        ([b"no HTTP at all\r\n\r\n"], "no WebSocket"),
        ([b"x" * 100_000], "has no end"),
        ([b""], "closed"),
        ([SHAKEN], "closed"),
        ([SHAKEN, told(op="welcome")], "another version"),
        ([SHAKEN, told(**(WELCOME | {"protocol": "1.0"}))], "1.0"),
        ([SHAKEN, told(op="refused", message='"quoted" \\')], "refused: "),
        ([SHAKEN, frame(1, b"{")], "refused"),
        ([GREETED, frame(8, b"\x03\xf0missing_scope")], "missing_scope"),
        (
            [
                GREETED,
                told(op="refused", message="lease_ms", id=None),
                frame(8, b"\x03\xebmal"),
            ],
            "refused: lease_ms",
        ),
        ([GREETED, frame(1, b"{}", flags=0xC0)], "no service sends"),
        ([GREETED, frame(1, b"{}", flags=0)], "one frame each"),
        ([GREETED, b"\x82\x7f" + b"\xff" * 8], "larger"),
        ([GREETED, b"\x82\x7f" + struct.pack(">Q", 2**62)], "larger"),
        ([GREETED, frame(2, b"short")], "too short"),
        ([GREETED, frame(2, b"\x02" + SAMPLES[1:])], "another version"),
        ([GREETED, frame(2, SAMPLES[:-4])], "as long as"),
        ([GREETED, frame(2, SAMPLES[:12] + b"\xff" * 4 + SAMPLES[16:])], "as long as"),
        ([GREETED, frame(2, FINGER[:4] + b"\x07\0" + FINGER[6:])], "as long as"),
        ([GREETED, frame(5, b"")], "unknown kind"),
        ([GREETED, *GOOD], "closed"),
        ([GREETED, *GOOD[:-1], frame(2, FINGER[:56] + NAN * 24)], "closed"),
        (
            [GREETED, *GOOD[:-1], frame(2, FINGER[:56] + struct.pack("<24f", *[-1e30] * 24))],
            "closed",
        ),
    ],
)
def test_a_service_that_answers_wrongly_is_left(
    example: Path, answers: list[bytes], why: str
) -> None:
    done = answered_by(example, *answers)
    faultless(done)
    assert done.returncode == 1
    assert why in done.stderr


def test_a_frame_of_a_later_version_is_passed_over(example: Path) -> None:
    later = SAMPLES[:44] + b"\x09" + SAMPLES[45:]
    assert "closed" in answered_by(example, GREETED, frame(2, later)).stderr


def test_spoilt_answers_break_nothing(example: Path, rng: np.random.Generator) -> None:
    whole = b"".join([GREETED, *GOOD])
    for _ in range(100):
        spoilt = bytearray(whole)
        for at in rng.integers(len(SHAKEN), len(whole), rng.integers(1, 8)):
            spoilt[at] = rng.integers(256)
        cut = rng.integers(len(SHAKEN), len(whole)) if rng.random() < 0.3 else len(whole)
        faultless(answered_by(example, bytes(spoilt[:cut])))


@pytest.fixture(scope="module")
def comma(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The environment of a locale with a decimal comma, made here: machines have few."""
    if shutil.which("localedef") is None:
        pytest.skip("there is no localedef here: glibc brings it")
    folder = tmp_path_factory.mktemp("locales")
    (folder / "comma.def").write_text(COMMA)
    command = ["localedef", "--no-archive", "-c", "-i", "comma.def", "./comma"]
    subprocess.run(command, cwd=folder, capture_output=True, timeout=60.0)
    assert (folder / "comma" / "LC_NUMERIC").exists()
    return dict(os.environ) | {"LOCPATH": str(folder), "LC_ALL": "comma"}


def frames_of(sent: bytes) -> list[tuple[int, bytes]]:
    """Return opcode and payload of each frame of a client, which are masked."""
    frames = []
    while sent:
        size, head = sent[1] & 0x7F, 2
        if size == 126:
            (size,), head = struct.unpack(">H", sent[2:4]), 4
        mask = (sent[head : head + 4] * (size // 4 + 1))[:size]
        payload = sent[head + 4 : head + 4 + size]
        frames.append(
            (sent[0] & 0x0F, bytes(a ^ b for a, b in zip(payload, mask, strict=True)))
        )
        sent = sent[head + 4 + size :]
    return frames


def test_edges_in_a_locale_with_a_comma(tmp_path: Path, comma: dict[str, str]) -> None:
    source = Path(__file__).parent / "edges.c"
    program = compiled(tmp_path, "gcc", *CHECKED, source=source)
    compiled(tmp_path, "g++", "-x", "c++", source=source)
    sent = bytearray()
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def serve() -> None:
            connection, _ = listener.accept()
            with connection:
                connection.recv(4_096)
                opened = told(op="stream_opened", rig="rig1", ticket=1, applied=None, id=1)
                connection.sendall(GREETED + opened)
                while data := connection.recv(65_536):  # and says nothing more
                    sent.extend(data)

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        command = [str(program), "127.0.0.1", str(listener.getsockname()[1])]
        done = subprocess.run(command, env=comma, capture_output=True, text=True, timeout=60.0)
        thread.join(10.0)
    faultless(done)
    assert done.returncode == 0, done.stdout
    said = done.stdout.splitlines()
    assert said[0] == "locale 0,5"
    numbers = dict(line.split()[1:] for line in said if line.startswith("number "))
    none = "-1000000"
    assert numbers == {
        "0": "0",
        "-0.25": "-250000",
        "12.5e1": "125000000",
        "25E-2": "250000",
        "1700000000000000": "1700000000000000000000",
        **dict.fromkeys([".", "null", "-", "1e", "1x", '"1"', "1e999"], none),
    }
    assert "peak -1 -1" in said
    refused = [line for line in said if line.startswith("update ")]
    assert len(refused) == 9
    assert all(line.startswith("update -1 ") for line in refused)
    assert said[-2:] == ["good 0", "end the service has fallen silent"]
    frames = frames_of(bytes(sent))
    asked = [json.loads(payload) for opcode, payload in frames if opcode == 1]
    assert [one["peak_n"] for one in asked if one["op"] == "open_stream"] == [0.05]
    [update] = [StreamFrame.unpack(payload) for opcode, payload in frames if opcode == 2]
    assert (update.ticket, update.period, update.friction_n.min()) == (
        1,
        2.0,
        np.float32(-0.05),
    )
