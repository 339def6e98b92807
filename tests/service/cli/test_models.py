"""`frictus models` on a registry of its own."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from scipy.io import loadmat
from typer.testing import CliRunner

from frictus.model import Model
from frictus_service.cli.app import app
from frictus_service.cli.options import Exit
from frictus_service.discovery.document import (
    Discovery,
    Gain,
    NamedCause,
    ParameterEstimate,
    StudyFacts,
)
from frictus_service.errors import RegistryUnavailableError
from frictus_service.registry.aliases import Activations

MODEL = {
    "base": {
        "law": "first_order_speed",
        "gain_n": 0.4,
        "cutoff_0_hz": 400.0,
        "slope_hz_per_mm_s": 12.0,
    },
    "participant": "P01",
    "provenance": {"source": "a test", "rig": "fake"},
}


@pytest.fixture
def models(tmp_path: Path) -> Any:
    """Run a command of `frictus models`; return what it writes."""
    file = tmp_path / "own.toml"
    file.write_text('[registry]\nurl = "sqlite:///own.db"\n', encoding="utf-8")

    def run(command: str, *args: object, fails: Exit | None = None, config: Path = file) -> Any:
        words = ["models", command, *map(str, args), "-c", str(config)]
        result = CliRunner().invoke(app, words)
        assert result.exit_code == (fails or Exit.OK), result.stderr
        if fails is not None:
            return result.stderr
        return [json.loads(line) for line in result.stdout.splitlines()]

    return run


@pytest.fixture
def document(tmp_path: Path) -> Path:
    file = tmp_path / "model.json"
    file.write_text(json.dumps(MODEL), encoding="utf-8")
    return file


def test_publish_list_show(models: Any, document: Path, tmp_path: Path) -> None:
    for version in (1, 2):
        (said,) = models("publish", document, "--comment", "by hand")
        assert said["reference"] == f"fake/P01@{version}"
    assert said["message"] == ""
    models("publish", document, "--name", "other/P01", "--rig", "other")
    assert (tmp_path / "own.db").exists()  # beside the configuration
    listed = models("list")
    assert [row["rig"] for row in listed] == ["other", "fake", "fake"]
    assert [row["version"] for row in models("list", "--name", "fake/P01", "--newest")] == [2]
    (shown,) = models("show", "fake/P01@1")
    assert shown["model"]["base"] == MODEL["base"]
    assert shown["comment"] == "by hand"


def test_a_list_marks_models_that_a_simulated_rig_measured(
    models: Any, document: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    models("publish", document)
    virtual = MODEL | {"provenance": {"source": "a test", "rig": "fake", "simulated": True}}
    document.write_text(json.dumps(virtual), encoding="utf-8")
    models("publish", document)
    assert [row["simulated"] for row in models("list")] == [True, False]
    monkeypatch.setattr("frictus_service.cli.models.wants_lines", lambda _: False)
    done = CliRunner(env={"COLUMNS": "150"}).invoke(
        app, ["models", "list", "-c", str(tmp_path / "own.toml")]
    )
    marked = [line for line in done.stdout.splitlines() if "fake (simulated)" in line]
    assert ["fake/P01@2" in line for line in marked] == [True]


@pytest.mark.parametrize("encoding", ["ascii", "cp437"])
def test_what_the_encoding_of_a_terminal_lacks_is_escaped(
    encoding: str, models: Any, document: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    comment = "Ö, 3 µs → right"
    models("publish", document, "--comment", comment)
    monkeypatch.setenv("PYTHONIOENCODING", encoding)
    monkeypatch.setenv("TERM", "dumb")  # without colours
    terminal = "import sys; sys.stdout.isatty = lambda: True; "
    main = "from frictus_service.cli import main; main()"
    words = ["models", "show", "fake/P01", "-c", str(tmp_path / "own.toml")]
    done = subprocess.run(
        [sys.executable, "-c", terminal + main, *words], capture_output=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, b"")
    assert comment.encode(encoding, "backslashreplace") in done.stdout


def test_a_name_that_reads_as_another_participant_is_remarked_on(
    models: Any, document: Path
) -> None:
    (said,) = models("publish", document, "--name", "fake/P02")
    assert "model of participant 'P01', though 'fake/P02' reads as" in said["message"]
    (said,) = models("publish", document, "--name", "population")
    assert said["message"] == ""


def test_the_extended_model_of_a_discovery_is_published_with_its_origin(
    models: Any, tmp_path: Path
) -> None:
    base = Model.model_validate({**MODEL, "participant": None})
    effect = {"id": "direction_asymmetry", "parameters": {"share": 0.06}}
    extended = Model.model_validate({**base.model_dump(by_alias=True), "effects": [effect]})
    gain = Gain(heldout_loglik=30.0, ci95=None, residual_db=(1.0, 0.5), residual_deg=(2.0, 1.0))
    cause = NamedCause(
        id="direction_asymmetry",
        statement="It feels otherwise from right to left.",
        verdict="confirmed",
        parameters={"share": ParameterEstimate(value=0.06, ci95=(0.05, 0.07), unit="1")},
        p_value=0.01,
        gain=gain,
        alternatives=(),
        next_experiment="Turn the screen round.",
    )
    report = Discovery(
        code_version="1.2.3",
        seed=7,
        study=StudyFacts(
            path="s.h5", sha256="ab" * 32, participants=8, trials=9, trials_used=8
        ),
        response="friction",
        base_model=base,
        extended_model=extended,
        verdict="explained",
        causes=(cause,),
        cannot_tell=(),
        unexplained=(),
        explained_share=0.9,
        gain=gain,
    )
    file = tmp_path / "report.json"
    file.write_bytes(report.to_json())
    models("publish", file)
    (shown,) = models("show", "population@1")
    assert shown["model"]["effects"] == [effect]
    told = shown["model"]["provenance"]
    assert told["study_sha256"] == "ab" * 32
    assert told["discovered"] == {"direction_asymmetry": "confirmed"}
    assert told["settings"]["seed"] == 7
    assert told["source"] == "a test"  # what the base model said is kept
    clean = report.model_copy(update={"causes": (), "verdict": "clean"})
    file.write_bytes(clean.to_json())
    assert "names no cause" in models("publish", file, fails=Exit.USAGE)
    file.write_text('{"schema": "discovery/1"}', encoding="utf-8")
    assert "discovery/1" in models("publish", file, fails=Exit.USAGE)


def test_comments_are_no_markup(
    models: Any, document: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    models(
        "publish",
        document,
        "--comment",
        "[/x] [P]\x1b[2J",
        "--rig",
        "[/r]\x9b1m",
        "--name",
        "fake/P01",
    )
    monkeypatch.setattr("frictus_service.cli.models.wants_lines", lambda _: False)
    for command in (["list"], ["show", "fake/P01"], ["compare", "fake/P01", "fake/P01@1"]):
        words = ["models", *command, "-c", str(tmp_path / "own.toml")]
        shown = CliRunner(env={"COLUMNS": "200"}).invoke(app, words)
        assert shown.exit_code == Exit.OK, shown.stderr
        assert command[0] == "compare" or "[/x] [P]" in shown.stdout
        assert not {"\x1b", "\x9b"}.intersection(shown.stdout)  # a terminal would obey


def test_alias_and_compare(models: Any, document: Path) -> None:
    models("publish", document)
    models("publish", document)
    models("alias", "fake/P01@production", 1)
    (moved,) = models("alias", "fake/P01@production", 2, "--reason", "newer")
    assert (moved["from_version"], moved["version"], moved["revision"]) == (1, 2, 2)
    (shown,) = models("show", "fake/P01@production")
    assert (shown["version"], shown["moves"][0]["reason"]) == (2, "newer")
    (compared,) = models("compare", "fake/P01@1", "fake/P01@production")
    assert compared["parameters"]["gain_n"]["difference"] == 0.0
    assert "production" in models("alias", "fake/P01", 1, fails=Exit.USAGE)
    assert "no model" in models("alias", "fake/P01@production", 9, fails=Exit.USAGE)
    assert "999999999" in models("alias", "fake/P01@production", 10**20, fails=Exit.USAGE)


def test_activate_tells_what_the_rig_confirmed(
    models: Any, document: Path, rig: Any, config: Path
) -> None:
    models("publish", document, config=config)
    rig.remarks = "without the skew"
    (said,) = models("activate", "fake", "fake/P01", config=config)
    assert said["confirmed"] == "s1"  # this rig names whatever it gets so
    assert said["as_published"] is False
    assert said["message"] == "without the skew"
    (shown,) = models("show", "fake/P01", config=config)
    assert shown["activations"][0]["rig"] == "fake"
    rig.refusal = ("conflict", "the model changes only while disarmed")
    told = models("activate", "fake", "fake/P01", config=config, fails=Exit.REFUSED)
    assert "disarmed" in told


def test_an_activation_that_is_not_noted_is_told_as_one(
    models: Any, document: Path, rig: Any, config: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def away(*_: Any, **__: Any) -> None:
        raise RegistryUnavailableError("the registry is away")

    models("publish", document, config=config)
    monkeypatch.setattr(Activations, "record", away)
    told = models("activate", "fake", "fake/P01", config=config, fails=Exit.NO_LINK)
    assert "rig fake applies fake/P01@1 now" in told
    assert "the registry is away" in told
    assert rig.wait_for("model")


def test_who_has_no_name_here_publishes_nevertheless(
    models: Any, document: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def nobody() -> str:
        raise KeyError("getpwuid(): uid not found: 12345")

    monkeypatch.setattr("getpass.getuser", nobody)
    models("publish", document)
    assert models("list")[0]["published_by"] == "unknown"


def test_export(models: Any, document: Path, tmp_path: Path) -> None:
    models("publish", document)
    as_json, as_mat = tmp_path / "out.json", tmp_path / "out.mat"
    assert models("export", "fake/P01", as_json) == []
    assert Model.model_validate_json(as_json.read_bytes()).base.law == "first_order_speed"
    models("export", "fake/P01", as_mat)
    assert loadmat(as_mat, simplify_cells=True)["parameters"]["gain_n"] == 0.4
    assert ".mat" in models("export", "fake/P01", tmp_path / "out.txt", fails=Exit.USAGE)


def test_what_cannot_be_published(models: Any, document: Path, tmp_path: Path) -> None:
    deep = tmp_path / "deep.json"
    deep.write_text("[" * 100_000, encoding="ascii")
    assert "deep.json holds no model/1" in models("publish", deep, fails=Exit.USAGE)
    broken = tmp_path / "broken.json"
    broken.write_text("{}", encoding="utf-8")
    assert "base" in models("publish", broken, fails=Exit.USAGE)
    broken.write_text(json.dumps({**MODEL, "provenance": {}}), encoding="utf-8")
    assert "--rig" in models("publish", broken, fails=Exit.USAGE)
    assert "study_sha256" in models("publish", broken, "--rig", "fake", fails=Exit.USAGE)
    assert models("publish", tmp_path / "absent.json", fails=Exit.USAGE)
    nowhere = tmp_path / "nowhere.toml"
    nowhere.write_text('[registry]\nurl = "postgresql+psycopg://x@127.0.0.1:1/x"\n', "utf-8")
    assert "registry.url" in models("list", config=nowhere, fails=Exit.NO_LINK)
    nowhere.write_text('[registry]\nurl = "mysql://x"\n', encoding="utf-8")
    assert "registry.url" in models("list", config=nowhere, fails=Exit.CONFIG)
