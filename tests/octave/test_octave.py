"""The class of MATLAB in Octave, at a real rig."""

import json
import re
import shutil
import socket
import subprocess
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.service.dashboard.page import (
    SECRETS,
    configuration,
    rig_that_follows_pages,
    serving,
)

from frictus.websocket.frames import Frame, Kind

pytestmark = pytest.mark.timeout(300)
SOURCE = Path(__file__).parents[2] / "clients" / "matlab"
HOW = "`apt-get install octave octave-instrument-control` brings it"


def octave(folder: Path, script: str) -> subprocess.CompletedProcess[str]:
    """Run a script; what it prints are lines of JSON."""
    path = folder / "script.m"
    path.write_text(f"addpath('{SOURCE.as_posix()}');\n{script}", encoding="utf-8")
    command = ["octave-cli", "--no-gui", "--quiet", "--norc", str(path)]
    return subprocess.run(command, capture_output=True, text=True, timeout=100.0)


@pytest.fixture(scope="module")
def needs_octave(tmp_path_factory: pytest.TempPathFactory) -> None:
    if shutil.which("octave-cli") is None:
        pytest.skip(f"there is no octave-cli here: {HOW}")
    loaded = octave(tmp_path_factory.mktemp("octave"), "pkg load instrument-control")
    if loaded.returncode != 0:
        assert "instrument-control" in loaded.stderr, loaded.stderr
        pytest.skip(f"Octave has no package instrument-control: {HOW}")


@pytest.fixture(scope="module")
def port(needs_octave: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    """A rig whose finger follows pages, and the API beside it."""
    with rig_that_follows_pages() as router:
        with serving(configuration(router, tmp_path_factory.mktemp("api"), True)) as port:
            yield port


def results(folder: Path, port: int, script: str, who: str = "render") -> list[Any]:
    opened = f"f = frictus('127.0.0.1', {port}, '{SECRETS[who]}');\n"
    done = octave(folder, f"{opened}{script}\nf.close();")
    assert done.returncode == 0, done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()]


def test_two_raw_streams_and_the_finger_without_a_loss(port: int, tmp_path: Path) -> None:
    script = """
f.watch('rig1', {'force', 'accel'});
got = f.read(1.0);
next = got.force.first_sample + got.force.columns;
for index = 1:3
  got = f.read(1.0);
  disp(jsonencode(struct('continues', got.force.first_sample == next + got.force.lost, ...
    'columns', got.force.columns, 'lost', got.force.lost + got.accel.lost, ...
    'channels', size(got.accel.data, 1), 'states', numel(got.finger.sample), ...
    'lost_states', got.finger.lost, 'rises', all(diff(got.finger.sample) > 0))));
  next = got.force.first_sample + got.force.columns;
end
printf('"%s"\\n', class(got.force.utc_ns));
disp(jsonencode(abs(double(got.force.utc_ns) / 1e9 - time()) < 60));
disp(jsonencode(f.newest.status.simulated));
"""
    *seconds, kind, near, simulated = results(tmp_path, port, script, "read")
    assert (kind, near, simulated) == ("uint64", True, True)
    assert all(second["continues"] and second["rises"] for second in seconds)
    assert sum(second["lost"] + second["lost_states"] for second in seconds) == 0
    assert sum(second["columns"] for second in seconds) > 2.5 * 20_000
    assert sum(second["states"] for second in seconds) > 2.5 * 200
    assert {second["channels"] for second in seconds} == {3}


def test_a_texture_is_streamed_while_the_rig_is_held(port: int, tmp_path: Path) -> None:
    script = """
f.watch('rig1');
f.arm('rig1', 10000);
applied = f.set_scene('rig1', '{"name": "from Octave"}');
disp(jsonencode(applied.applied.gain));
f.open_stream('rig1', 0.05);
try
  f.send([0 0.06], 2.0);
catch cause
  disp(jsonencode(cause.message));
end
for index = 1:10
  f.send(0.04 * cos(2 * pi * (0:63) / 64), 2.0, 2000);
  f.read(0.1);
end
disp(jsonencode(f.newest.status.owner));
disp(jsonencode(f.close_stream()));
f.disarm('rig1');
disp(jsonencode(f.client));
"""
    gain, refused, owner, closed, client = results(tmp_path, port, script)
    assert gain == 1.0
    assert refused == "friction: within the declared peak of 0.05 N"
    assert owner == client
    assert closed["sent"] + closed["superseded"] == 10
    assert (closed["expired"], closed["newest"]) == (0, 9)


def test_what_is_sent_to_a_stream_that_has_ended_is_an_error(port: int, tmp_path: Path) -> None:
    script = """
ends = {@() f.disarm('rig1'), @() f.http('POST', '/v1/rigs/rig1/stop')};
for index = 1:2
  f.arm('rig1', 10000);
  f.open_stream('rig1', 0.05);
  f.send(0.04 * cos(2 * pi * (0:63) / 64), 2.0, 2000);
  ends{index}();
  f.read(1.0);
  try
    f.send(0.04 * cos(2 * pi * (0:63) / 64), 2.0, 2000);
  catch cause
    disp(jsonencode({cause.identifier, cause.message}));
  end
end
"""
    (code, given_back), (again, stopped) = results(tmp_path, port, script)
    assert code == again == "frictus:no_stream"
    assert given_back == "the stream has ended: the rig was given back"
    assert stopped.startswith("the stream has ended: the rig is ")  # by whom it was stopped


def test_text_is_utf_8_both_ways(port: int, tmp_path: Path) -> None:
    script = """
f.watch('rig1');
f.set_scene('rig1', '{"name": "grün 漢 😀"}');
while ~isfield(f.newest, 'scene') || ~strncmp(f.newest.scene.scene.name, 'gr', 2)
  f.read(0.05);
end
disp(jsonencode(f.newest.scene.scene.name));
f.http('PUT', '/v1/rigs/rig1/scene', '{"name": "weiß"}');
disp(jsonencode(f.http('GET', '/v1/rigs/rig1/scene').name));
"""
    assert results(tmp_path, port, script) == ["grün 漢 😀", "weiß"]


def test_textures_are_made_and_what_is_no_json_is_returned(port: int, tmp_path: Path) -> None:
    script = """
texture = '{"kind": "beta", "alpha": 3, "beta": 3, "rms_n": 0.01, "seed": 0}';
made = f.http('PUT', '/v1/textures/of-octave', texture, 'If-None-Match: *');
disp(jsonencode(made.name));
try
  f.http('PUT', '/v1/textures/of-octave', texture, 'If-None-Match: *');
catch cause
  disp(jsonencode(cause.identifier));
end
disp(jsonencode(isempty(f.http('DELETE', '/v1/textures/of-octave'))));
disp(jsonencode(numel(strfind(f.http('GET', '/metrics'), 'frictus_router_linked 1.0'))));
try
  f.http('GET', '/v1/rigs/grün');
catch cause
  disp(jsonencode({cause.identifier, cause.message}));
end
"""
    made, again, removed, linked, (code, told) = results(tmp_path, port, script)
    assert (made, again, removed, linked) == ("of-octave", "frictus:conflict", True, 1)
    assert code == "frictus:bad_http"
    assert told == (
        "GET /v1/rigs/grün: Invalid HTTP request received. accepted: HTTP/1.1, one "
        "Host header, a path that is percent-encoded"
    )


def test_extremes_as_asked(port: int, tmp_path: Path) -> None:
    script = """
f.watch('rig1', {'force'}, 50);
got = f.read(1.0);
disp(jsonencode([got.force.samples_per_column, size(got.force.low, 1), ...
  all(got.force.low(:) <= got.force.high(:))]));
"""
    assert results(tmp_path, port, script, "read") == [[50, 3, 1]]


def test_rest_is_asked_and_refusals_are_errors(port: int, tmp_path: Path) -> None:
    script = """
f.watch('rig1', {'force'});
f.read(1.0);  % the rig is known by now
disp(jsonencode(f.http('GET', '/v1/rigs')));
disp(jsonencode(f.http('PUT', '/v1/rigs/rig1/scene', '{"name": "by HTTP"}').gain));
function attempt(work)
  try
    work();
  catch cause
    printf('"%s"\\n', cause.identifier);
  end
end
attempt(@() f.http('GET', '/v1/rigs/none'));
attempt(@() f.arm('none'));
attempt(@() f.open_stream('rig1', 0.05));
attempt(@() f.send([0 0], 1.0));
attempt(@() frictus('127.0.0.1', PORT, 'no token of anybody'));
attempt(@() frictus('127.0.0.1', 1));
"""
    rigs, gain, *errors = results(tmp_path, port, script.replace("PORT", str(port)))
    assert (rigs["rigs"], gain) == (["rig1"], 1.0)
    codes = ("no_rig", "no_rig", "not_armed", "no_stream", "unauthenticated", "no_link")
    assert errors == [f"frictus:{code}" for code in codes]


WELCOME = b'{"op":"welcome","protocol":"1.1","client":"x","utc_us":1700000000000000}'
SWITCHED = b"HTTP/1.1 101 Switching Protocols\r\n\r\n"
GREETED = SWITCHED + b"\x81%c%s" % (len(WELCOME), WELCOME)


@pytest.mark.parametrize(
    ("answer", "code"),
    [
        (b"HTTP/1.1 403 Forbidden\r\n\r\n", "no_websocket"),
        (GREETED + b"\x82\x7f" + b"\x7f" * 8, "frame"),
        (GREETED + b"\x82\x05short", "frame"),
        (GREETED + b"\x88\x0f\x03\xf0missing_scope", "closed"),
        (GREETED, "closed"),
    ],
)
def test_a_service_that_answers_wrongly_is_left(
    needs_octave: None, tmp_path: Path, answer: bytes, code: str
) -> None:
    left = asked_of(answer, tmp_path, "f.read(10.0);")
    assert re.fullmatch(rf"frictus:{code}\n", left.stdout), left.stdout + left.stderr


def asked_of(
    answer: bytes, tmp_path: Path, script: str, *later: bytes
) -> subprocess.CompletedProcess[str]:
    """Run a script with `f`, connected to what says this, more when asked, and then nothing."""
    done = threading.Event()
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def serve() -> None:
            connection, _ = listener.accept()
            with connection:
                for said in (answer, *later):
                    connection.recv(4_096)
                    connection.sendall(said)
                done.wait(60.0)

        thread = threading.Thread(target=serve)
        thread.start()
        port = listener.getsockname()[1]
        told = octave(
            tmp_path,
            f"try, f = frictus('127.0.0.1', {port});\n{script}\n"
            "catch cause, disp(cause.identifier), end",
        )
        done.set()
        thread.join(10.0)
    return told


def message(opcode: int, payload: bytes) -> bytes:
    """A message of a service, as it is on the wire."""
    return bytes([0x80 | opcode, 126]) + len(payload).to_bytes(2, "big") + payload


def columns(run: int, first_sample: int, lost: int = 0) -> bytes:
    """Two raw samples of force x."""
    data = np.array([[first_sample, first_sample + 1]], dtype=np.float32)
    frame = Frame(1, 0, run, first_sample, lost, 20_000.0, 1, Kind.RAW, 10**18, data)
    return message(2, frame.pack())


def test_what_is_lost_and_a_new_run_show(needs_octave: None, tmp_path: Path) -> None:
    sent = columns(7, 100) + columns(7, 105, lost=3) + columns(3, 0)
    script = """
for index = 1:2
  force = f.read(0.3).force;
  disp(jsonencode(struct('run', force.run, 'sample', force.sample, 'data', force.data, ...
    'lost', force.lost)));
end
"""
    told = asked_of(GREETED + sent, tmp_path, script)
    before, after = map(json.loads, told.stdout.splitlines())
    assert (before["run"], before["lost"]) == (7, 3), told.stderr
    assert before["sample"] == before["data"] == [100, 101, 105, 106]
    assert (after["run"], after["lost"], after["sample"]) == (3, 0, [0, 1])


def test_what_comes_with_a_refusal_is_read(needs_octave: None, tmp_path: Path) -> None:
    refused = b'{"op":"refused","what":"point","code":"no_rig","message":"m","id":null}'
    script = """
f.watch('rig1');
try, f.read(0.3); catch cause, printf('"%s"\\n', cause.identifier); end
disp(jsonencode(f.read(0.3).force.sample));
"""
    sent = message(1, refused) + columns(7, 100)
    told = asked_of(SWITCHED, tmp_path, script, message(1, WELCOME), sent)
    assert told.stdout.splitlines() == ['"frictus:no_rig"', "[100,101]"], told.stderr
