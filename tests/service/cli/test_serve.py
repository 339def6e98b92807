"""What `frictus serve` says before anything runs."""

import socket
from pathlib import Path

import pytest
from typer.testing import CliRunner

from frictus.errors import RefusedError
from frictus_hardware.errors import DeviceLostError, DriverMissingError, HardwareError
from frictus_hardware.simulated.takeover import TakeoverStrokes
from frictus_service.cli.app import app
from frictus_service.cli.options import Exit, code_of, sentence_of
from frictus_service.cli.serve import where_to_look
from frictus_service.config import ApiConfig, Config, RouterConfig, Token
from frictus_service.daemon.processes.supervisor import Supervisor
from frictus_service.demonstration.stage import LEASE_MS, demo_config
from frictus_service.errors import StartError

TOKENS = (Token(name="ann", scopes=("read",), value="a-token-of-a-test"),)


@pytest.mark.parametrize(
    ("host", "named"),
    [
        ("127.0.0.1", "127.0.0.1"),
        ("::1", "[::1]"),
        ("192.0.2.2", "192.0.2.2"),
        ("0.0.0.0", socket.gethostname()),  # no browser opens that one
        ("::", socket.gethostname()),
    ],
)
def test_the_page_is_said_at_an_address_that_can_be_opened(host: str, named: str) -> None:
    said = where_to_look(ApiConfig(host=host, port=8420, tokens=TOKENS))
    assert f"http://{named}:8420/ " in said
    assert f"http://{named}:8420/docs" in said


@pytest.mark.parametrize("part", ["serve", "api", "recorder"])
def test_folders_that_cannot_be_used_are_said_at_the_start(
    part: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("frictus_service.daemon.processes.serve.serve", lambda *_, **__: None)
    for key in ("recordings", "studies"):
        (tmp_path / key).write_text("no folder")
    file = tmp_path / "frictus.toml"
    file.write_text('recordings = "recordings"\nstudies = "studies/of/2026"\n')
    said = CliRunner().invoke(app, [part, "-c", str(file)]).stderr
    assert f"recordings: {tmp_path / 'recordings'} is no folder: name another" in said
    assert f"studies: {tmp_path / 'studies'} is no folder: name another" in said
    assert "textures" not in said


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (DriverMissingError("no NI-DAQmx here: install it"), Exit.CONFIG),
        (DeviceLostError("Dev1 is gone: check its cable"), Exit.NO_LINK),
    ],
)
def test_a_device_out_of_reach_is_told_as_it_is(error: HardwareError, code: Exit) -> None:
    assert code_of(error) == code
    assert sentence_of(error) == str(error)


def test_who_meets_a_trip_is_told_how_it_is_reset() -> None:
    """There is no command for it."""
    tripped = RefusedError("tripped", "tripped by a deadline fault. Then reset the rig.")
    assert "by POST /v1/rigs/RIG/reset" in sentence_of(tripped)
    assert sentence_of(RefusedError("not_owner", "held")) == "held"


def test_a_demo_is_as_patient_with_a_page_as_with_its_terminal(tmp_path: Path) -> None:
    config = demo_config(tmp_path, TakeoverStrokes(), 0, 1)
    assert config.api.page_lease_ms == LEASE_MS


def test_a_router_that_cannot_listen_is_a_part_that_did_not_start() -> None:
    """As the API is, whose port is in use: both end with 1."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        endpoint = f"tcp/127.0.0.1:{taken.getsockname()[1]}"
        config = Config(router=RouterConfig(endpoint=endpoint))
        with (
            pytest.raises(StartError, match="router: cannot listen") as refused,
            Supervisor(config, ()),
        ):
            pass
    assert code_of(refused.value) == Exit.UNEXPECTED
