"""Writers in processes of their own, several at once and killed in the middle."""

import contextlib
import subprocess
import sys
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from sqlalchemy import text

from frictus.model import Model
from frictus_service.registry.store import Registry

pytestmark = pytest.mark.long

MakeModel = Callable[..., Model]
WRITER = """
import sys
from frictus.model import Model
from frictus_service.registry.store import Registry

url, who, names, count = sys.argv[1], sys.argv[2], sys.argv[3].split(","), int(sys.argv[4])
print("ready", flush=True)
model = Model.model_validate_json(sys.stdin.readline())
with Registry(url) as registry:
    for number in range(count):
        name = names[number % len(names)]
        made = registry.publish(model, name, by=who, comment=str(number))
        registry.aliases.move(name, "newest", made.version, by=who, replaces="*")
        print(made.reference, number, flush=True)
"""


@contextlib.contextmanager
def writer(
    url: str, who: str, names: list[str], count: int
) -> Iterator["subprocess.Popen[str]"]:
    """Start a writer, ready to write as soon as it is given its model."""
    command = [sys.executable, "-c", WRITER, url, who, ",".join(names), str(count)]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "ready\n"
            yield process
        finally:
            process.kill()


def begin(process: "subprocess.Popen[str]", model: Model) -> None:
    assert process.stdin is not None
    process.stdin.write(model.to_json().decode() + "\n")
    process.stdin.flush()


def everything(registry: Registry) -> dict[str, tuple[str, str]]:
    """Return who published each reference, and the comment."""
    found: dict[str, tuple[str, str]] = {}
    after = 0
    while True:
        page = registry.find(after=after, limit=1_000)
        found |= {m.reference: (m.published_by, m.comment) for m in page.models}
        if page.next is None:
            return found
        after = page.next


def check_whole(registry: Registry) -> None:
    """Versions have no gaps, documents no tears, aliases and their audit agree."""
    versions: dict[str, set[int]] = {}
    for reference in everything(registry):
        name, _, version = reference.partition("@")
        versions.setdefault(name, set()).add(int(version))
    for name, found in versions.items():
        assert found == set(range(1, len(found) + 1))
        assert registry.get(f"{name}@{len(found)}").etag
        for alias in registry.aliases.of(name):
            newest = registry.aliases.moves(name, 1)[0]
            assert (newest.revision, newest.to_version) == (alias.revision, alias.version)
            assert len(registry.aliases.moves(name, 10_000)) == alias.revision
    if str(registry.database).startswith("sqlite"):
        with registry.database.read() as connection:
            assert connection.execute(text("PRAGMA integrity_check")).scalar_one() == "ok"
            assert not connection.execute(text("PRAGMA foreign_key_check")).all()


def acknowledged_by(who: str, lines: list[str]) -> dict[str, tuple[str, str]]:
    """Return what a writer said it had written; the last line may have been cut off."""
    whole = [line.split() for line in lines if line.endswith("\n")]
    return {reference: (who, number) for reference, number in whole}


def write_and_kill(
    url: str, model: Model, kills: int, name: str, rng: np.random.Generator
) -> dict[str, tuple[str, str]]:
    """Let writers write at once, kill all but one; return what they acknowledged."""
    told: dict[str, tuple[str, str]] = {}
    with contextlib.ExitStack() as all_of_them:
        names = ["a", "b", name]
        doomed = {
            f"{name}-{number}": all_of_them.enter_context(
                writer(url, f"{name}-{number}", names, 100_000)
            )
            for number in range(kills)
        }
        spared = all_of_them.enter_context(writer(url, f"{name}-spared", names, 15))
        for process in [*doomed.values(), spared]:
            begin(process, model)  # they open the registry, and make its tables, at once
        for who, process in doomed.items():
            assert process.stdout is not None
            lines = [process.stdout.readline() for _ in range(rng.integers(1, 30))]
            process.kill()  # somewhere in the middle of the next
            lines += process.stdout.read().splitlines(keepends=True)
            told |= acknowledged_by(who, lines)
        output, _ = spared.communicate(timeout=100.0)
        assert spared.returncode == 0
        told |= acknowledged_by(f"{name}-spared", output.splitlines(keepends=True))
    return told


def test_what_was_acknowledged_survives_kills(
    registry: Registry, url: str, model: MakeModel, rng: np.random.Generator
) -> None:
    told = write_and_kill(url, model(), 2, "c", rng)
    kept = everything(registry)
    assert told.items() <= kept.items()
    assert sum(who == "c-spared" for who, _ in told.values()) == 15
    assert len(kept) <= len(told) + 2  # written, but killed before it was told
    check_whole(registry)


@pytest.mark.campaign
@pytest.mark.timeout(1_800)
def test_what_was_acknowledged_survives_forty_kills(
    registry: Registry, url: str, model: MakeModel, rng: np.random.Generator
) -> None:
    told: dict[str, tuple[str, str]] = {}
    for batch in range(20):
        told |= write_and_kill(url, model(), 2, f"batch{batch}", rng)
        kept = everything(registry)
        assert told.items() <= kept.items()
        assert len(kept) <= len(told) + 2 * (batch + 1)
    check_whole(registry)
    print(f"40 kills, {len(told)} acknowledged writes, none lost")  # noqa: T201
