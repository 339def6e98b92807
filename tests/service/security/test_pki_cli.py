"""`frictus pki` as a lab uses it."""

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from frictus_service.cli.app import app
from frictus_service.cli.options import Exit

from .conftest import DAY, Authority


def pki(*words: object) -> Result:
    return CliRunner().invoke(app, ["pki", *map(str, words)])


def line(result: Result) -> Any:
    assert result.exit_code == Exit.OK, result.output
    return json.loads(result.stdout)


def test_an_authority_and_what_it_signs(tmp_path: Path) -> None:
    folder = tmp_path / "pki"
    made = line(pki("create", "--folder", folder, "--name", "our lab", "--json"))
    assert Path(made["certificate"]) == folder / "ca.pem"
    out = tmp_path / "out"
    words = ("issue", "rig", "lab/rig1", "--folder", folder, "--out", out, "--days", 7)
    made = line(pki(*words, "--json"))
    assert Path(made["key"]) == out / "rig-lab-rig1.key"
    shown = line(pki("show", made["certificate"], "--json"))
    assert (shown["role"], shown["name"], shown["issuer"]) == ("rig", "lab/rig1", "our lab")
    assert shown["state"] == "valid"


def test_a_router_says_under_which_hosts_it_is_reached(tmp_path: Path) -> None:
    Authority(tmp_path)
    hosts = ("--host", "10.0.0.7", "--host", "hall.example")
    made = line(pki("issue", "router", "hall", *hosts, "--folder", tmp_path, "--json"))
    assert line(pki("show", made["certificate"], "--json"))["hosts"] == list(hosts[1::2])


def test_what_has_expired_is_told_by_the_exit_code(tmp_path: Path) -> None:
    expired = Authority(tmp_path).sign("observer:old", age=2 * DAY, lasts=DAY)
    result = pki("show", expired.certificate, "--json")
    assert result.exit_code == Exit.CHECK_FAILED
    assert json.loads(result.stdout)["state"] == "expired"


def test_a_certificate_that_is_not_there_is_not_called_none(tmp_path: Path) -> None:
    said = pki("show", tmp_path / "nowhere.pem").stderr
    assert "cannot be read: No such file" in said
    assert "no certificate" not in said


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("create",), "exists"),
        (("issue", "observer", "bob"), "exists"),
        (("issue", "admin", "eve"), "router, rig, controller, observer accepted"),
        (("issue", "rig", "rig1"), "rig 'rig1': accepted: SITE/RIG, as `site` and `rig` in"),
        (("issue", "controller", "a/b"), "controller 'a/b': accepted: one name"),
        (("issue", "router", "hall"), "router 'hall': no hosts"),
        (("issue", "rig", "lab/rig1", "--host", "x"), "only a router has hosts"),
    ],
)
def test_a_refusal_is_one_sentence(words: tuple[str, ...], told: str, tmp_path: Path) -> None:
    Authority(tmp_path).sign("observer:bob")
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    result = pki(*words, "--folder", tmp_path)
    assert result.exit_code == Exit.USAGE
    assert told in result.stderr
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_there_must_be_an_authority(tmp_path: Path) -> None:
    result = pki("issue", "observer", "bob", "--folder", tmp_path)
    assert (result.exit_code, "ca.pem" in result.stderr) == (Exit.USAGE, True)
