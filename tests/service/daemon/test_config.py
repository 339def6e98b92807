"""The configuration: what is shipped loads, what is wrong is named with its line."""

import sys
from pathlib import Path

import pytest

from frictus_service.config import Config
from frictus_service.config_file import load, parse
from frictus_service.errors import ConfigurationError

ROOT = Path(__file__).parents[3]
FILE = Path("frictus.toml")
SHA256 = "9f9f5111f7b27a781f1f1ddde5ebc2dd2b796bfc7365c9c28b548e564176929f"
"""Of 0123456789abcdef."""


def fault_of(text: str) -> str:
    with pytest.raises(ConfigurationError) as caught:
        parse(text, FILE)
    return str(caught.value)


@pytest.mark.parametrize("path", sorted((ROOT / "deploy").glob("*.toml")), ids=lambda p: p.name)
def test_what_is_shipped_loads(path: Path) -> None:
    load(path)


def test_shipped_example_states_the_defaults() -> None:
    shipped = load(ROOT / "deploy" / "frictus.toml")
    relative = ("textures", "recordings", "studies", "registry", "tracker")
    defaults = {name: getattr(Config(), name) for name in relative}
    assert shipped.model_copy(update=defaults) == Config()
    tracker = Config().tracker.within(ROOT / "deploy")
    assert shipped.tracker == tracker


def test_no_file_is_a_simulated_rig(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    config = load()
    assert config == Config()
    assert config.backend.kind == "simulated"
    assert config.block_samples == 100


def test_file_of_the_working_folder_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "frictus.toml").write_text('site = "here"\n', encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    assert load().site == "here"


def test_a_file_with_a_byte_order_mark_is_read(tmp_path: Path) -> None:
    path = tmp_path / "frictus.toml"
    path.write_text('site = "here"\n', encoding="utf-8-sig")  # as PowerShell writes it
    assert load(path).site == "here"


@pytest.mark.skipif(sys.platform == "win32", reason="a folder is refused as not permitted")
@pytest.mark.parametrize(
    ("name", "reason"), [("", "Is a directory"), ("absent.toml", "No such file or directory")]
)
def test_a_file_that_cannot_be_read_is_named_once(
    tmp_path: Path, name: str, reason: str
) -> None:
    with pytest.raises(ConfigurationError) as caught:
        load(tmp_path / name)
    assert str(caught.value) == f"{tmp_path / name}: cannot be read: {reason}"


def test_paths_are_relative_to_the_file(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    path.write_text('model_file = "m.json"\ntextures = "t"\n', encoding="utf-8")
    config = load(path)
    assert config.model_file == tmp_path / "m.json"
    assert config.textures == tmp_path / "t"
    assert config.registry.url == f"sqlite:///{(tmp_path / 'frictus.db').as_posix()}"
    assert config.tracker.audit == tmp_path / "adaptations.jsonl"


@pytest.mark.parametrize(
    "url", ["sqlite:////var/lib/frictus.db", "postgresql+psycopg://u:p@host/frictus"]
)
def test_registries_elsewhere_stay_where_they_are(tmp_path: Path, url: str) -> None:
    assert parse(f'[registry]\nurl = "{url}"\n', tmp_path / "rig.toml").registry.url == url


@pytest.mark.parametrize("url", ["frictus.db", "sqlite://", "sqlite:///:memory:", "mysql://x"])
def test_registries_that_cannot_be_shared_are_refused(url: str) -> None:
    assert "registry.url" in fault_of(f'[registry]\nurl = "{url}"\n')


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ('site = "lab"\nsyte = "x"\n', 2, ["syte", "did you mean 'site'", "block_ms"]),
        ("block_ms = 0.1\n", 1, ["block_ms", "greater than or equal to 1", "0.1"]),
        ('\n\nblock_ms = "5"\n', 3, ["block_ms", "valid number", "'5'"]),
        ("block_ms = nan\n", 1, ["block_ms"]),
        ('\nrecordings = "a\\u0000"\n', 2, ["recordings: control and formatting"]),
        ('[tracker]\naudit = "\\u202ea"\n', 2, ["tracker.audit: control and formatting"]),
        ("block_ms = 5.03\nsite = 'a'\n", 1, ["100.6 samples", "whole number"]),
        ("[limits]\n# comment\nfreeze_ms = 1\n", 3, ["limits.freeze_ms", "50"]),
        ("[limits]\nfreez_ms = 300\n", 2, ["limits.freez_ms", "did you mean 'freeze_ms'"]),
        (
            '[backend]\nkind = "simulated"\nsample_rate = 20000.0\n',
            3,
            ["backend.sample_rate", "did you mean 'sample_rate_hz'", "lead_ms"],
        ),
        (
            '[backend]\nkind = "simulated"\n'
            '[backend.finger]\nkind = "client"\nsmooth_hz = 1.0\n',
            5,
            ["backend.finger.smooth_hz", "did you mean 'smoothing_hz'"],
        ),
        ("[backend]\nlead_ms = 10.0\n", 1, ["backend.kind", "required", "'simulated'"]),
        ('[backend]\nkind = "nidaq"\n', 2, ["backend", "'simulated'", "'simulated_device'"]),
        ('backend.kind = "simulated"\nbackend.lead_ms = -1.0\n', 2, ["backend.lead_ms"]),
        ('[api]\nhost = "0.0.0.0"\n', 2, ["other machines", "[[api.tokens]]", "127.0.0.1"]),
        (
            '[[api.tokens]]\nname = "a"\nscopes = ["read"]\nvalue = "0123456789abcdef"\n'
            '[[api.tokens]]\nname = "b"\nscopes = ["write"]\nvalue = "0123456789abcdef"\n',
            7,
            ["api.tokens.1.scopes", "'read'", "'write'"],
        ),
        ('[[api.tokens]]\nname = "a"\nscopes = ["read"]\n', 1, ["sha256 or value"]),
        ('[[api.tokens]]\nscopes = ["read"]\n', 1, ["api.tokens.0.name", "required"]),
        ('[router]\nendpoint = "localhost"\n', 2, ["router.endpoint", "'localhost'"]),
        ('site = "lab"\nrig = \n', 2, ["not TOML"]),
        pytest.param(f"rig = {'[' * 250}{']' * 250}", 1, [], id="deep"),
        pytest.param(
            f"rig = {'[' * 5_000}{']' * 5_000}", 1, ["within each other"], id="very deep"
        ),
        ('site = "a/b"\n', 1, ["site", "'a/b'", "ASCII letters, digits"]),
        ('[router]\n\nendpoint = "tcp/a:99999"\n', 3, ["router.endpoint", "1 to 65535"]),
        ('[router]\nendpoint = "tcp/[::1]:0"\n', 2, ["router.endpoint", "1 to 65535"]),
        ('site = "a"\n[router]\nendpoint = "tls/a:7447"\n', 3, ["tls/HOST:PORT"]),
        ('site = "a"\n[security]\nauthority = "a.pem"\n', 2, ["tls/HOST:PORT"]),
        ('[router]\nlinks = ["tls/a:7447"]\n', 2, ["router.links.0", "tls/a:7447"]),
        (
            'security.authority = "a.pem"\n[router]\nendpoint = "tls/a:7447"\n'
            'links = ["tcp/b:7447"]\n',
            4,
            ["router.links", "without certificates only"],
        ),
        ('site = "a"\nrig = "b"\nblock_ms = 5.03\n', 3, ["block_ms", "whole number"]),
        (
            'site = "a"\n[backend]\nkind = "simulated"\nclock = 0.02\n',
            2,
            ["250 ms at a clock of 0.02", "limits.freeze_ms = 250", "at most 125 ms"],
        ),
        ("block_ms = 40\n[limits]\nfreeze_ms = 60\n", 1, ["at most 30 ms"]),
        (
            'site = "a"\n[backend]\nkind = "simulated"\nsample_rate_hz = 20010.0\n',
            4,
            ["backend.sample_rate_hz", "whole number"],
        ),
        (
            '[api]\npage_lease_ms = 1001\n[backend]\nkind = "simulated_device"\n',
            2,
            ["api.page_lease_ms", "at most 1000", "simulated"],
        ),
        ('site = "a"\n[api]\nport = 80\nhost = "0.0.0.0"\n', 4, ["api.host", "tokens"]),
        (
            '[[api.tokens]]\nname = "a"\nscopes = ["read"]\nvalue = "0123456789abcdef"\n'
            '[[api.tokens]]\nname = "a"\nscopes = ["read"]\nvalue = "0123456789abcdef"\n',
            6,
            ["api.tokens.1.name", "'a'"],
        ),
        (
            '[[api.tokens]]\nname = "a"\nscopes = ["read"]\nvalue = "0123456789abcdef"\n'
            '[[api.tokens]]\nname = "b"\nscopes = ["admin"]\n'
            f'sha256 = "{SHA256}"\n',
            5,
            ["api.tokens.1", "'a'", "same secret"],
        ),
        pytest.param(f"block_ms = {'1' * 5_000}\n", 2, ["not TOML", "4300"], id="digits"),
    ],
)
def test_fault_is_named_with_its_line(text: str, line: int, words: list[str]) -> None:
    message = fault_of(text)
    assert message.startswith(f"frictus.toml:{line}: "), message
    for word in words:
        assert word in message


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ('site = "a"\nmodel_file = "m.json"\n', 2),
        ('[backend]\nkind = "replay"\nfile = "m.json"\n', 3),
    ],
)
def test_files_of_the_rig_must_be_there_where_it_runs(
    tmp_path: Path, text: str, line: int
) -> None:
    path = tmp_path / "rig.toml"
    path.write_text(text, encoding="utf-8")
    load(path)  # of another machine
    with pytest.raises(ConfigurationError, match=rf"rig\.toml:{line}: .*no file .*m\.json"):
        load(path, runs_rig=True)
    (tmp_path / "m.json").touch()
    load(path, runs_rig=True)


def test_every_fault_is_named_at_once() -> None:
    message = fault_of('syte = "x"\nblock_ms = 0.0\n[limits]\nmax_lease_ms = 5\n')
    assert [part.split(":")[1] for part in message.splitlines()] == ["1", "2", "4"]


def test_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"absent\.toml.*cannot be read"):
        load(tmp_path / "absent.toml")


def test_a_token_matches_itself_alone() -> None:
    text = '[[api.tokens]]\nname = "a"\nscopes = ["read"]\nvalue = "0123456789abcdef"\n'
    token = parse(text, FILE).api.tokens[0]
    assert token.matches("0123456789abcdef")
    assert not token.matches("0123456789abcdeg")
    assert not token.matches("")
    assert "0123456789abcdef" not in repr(token)
    hashed = token.model_copy(
        update={
            "value": None,
            "sha256": SHA256,
        }
    )
    assert hashed.matches("0123456789abcdef")


@pytest.mark.parametrize("secret", ["schlüssel-0123456789", "with a space 0123456789", "short"])
def test_a_token_that_no_request_can_carry_is_refused_unrepeated(secret: str) -> None:
    told = fault_of(f'[[api.tokens]]\nname = "a"\nscopes = ["read"]\nvalue = "{secret}"\n')
    assert told.startswith("frictus.toml:4: api.tokens.0.value: ")
    assert secret not in told


def test_a_password_is_not_repeated() -> None:
    assert "secret" not in fault_of('[registry]\nurl = "mysql://ann:secret@db.lab/frictus"\n')


@pytest.mark.parametrize(
    ("text", "accepted"),
    [
        ('[router]\nendpoint = "udp/a:1"', "tcp/ADDRESS:PORT and tls/HOST:PORT are accepted"),
        ('[router]\nlinks = ["a"]', "tcp/ADDRESS:PORT is accepted"),
        ('[registry]\nurl = "mysql://ann:secret@a/b"', "sqlite:///FILE and postgresql+psycopg"),
        ('[registry]\nurl = "sqlite://"', "sqlite:///FILE and postgresql+psycopg"),
        ('[[api.tokens]]\nname = "a"\nscopes = ["read"]\nsha256 = "XX"', "64 digits of 0 to 9"),
        ('[api]\norigins = ["HTTP://A/"]', "https://HOST:PORT are accepted, in lower case"),
    ],
)
def test_what_is_accepted_is_said_in_words(text: str, accepted: str) -> None:
    fault = fault_of(text)
    assert accepted in fault
    assert "pattern" not in fault
    assert "secret" not in fault


@pytest.mark.parametrize("value", ['"' + "a" * 900_000 + '"', "1" + "0" * 4_000])
def test_a_huge_value_is_not_repeated(value: str) -> None:
    for key in ("rig", "block_ms"):
        assert len(fault_of(f"{key} = {value}")) < 300


@pytest.mark.parametrize("coding", ["latin-1", "utf-16"])
def test_a_file_in_another_coding_names_what_to_do(coding: str, tmp_path: Path) -> None:
    path = tmp_path / "frictus.toml"
    path.write_bytes('rig = "räg1"\n'.encode(coding))
    with pytest.raises(ConfigurationError, match=r"frictus.toml:1: no text in UTF-8: .* save"):
        load(path)
