"""Aliases move, one mover at a time, and every move is kept."""

import itertools
import threading
from collections.abc import Callable

import pytest

from frictus.model import Model
from frictus_service.errors import (
    AliasConflictError,
    RegistryNameError,
    UnknownModelError,
)
from frictus_service.registry.store import Registry

MakeModel = Callable[..., Model]
NAME = "rig1/P01"


@pytest.fixture
def filled(registry: Registry, model: MakeModel) -> Registry:
    for gain in (0.3, 0.4, 0.5):
        registry.publish(model(gain), NAME, by="ann")
    return registry


def test_an_alias_stands_for_the_version_it_was_moved_to(filled: Registry) -> None:
    move = filled.aliases.move
    made = move(NAME, "production", 1, by="ann", reason="first", replaces=None)
    assert filled.get(f"{NAME}@production").version == 1
    moved = move(NAME, "production", 3, by="ben", reason="better", replaces=made.etag)
    assert filled.get(f"{NAME}@production").version == 3
    back = move(NAME, "production", 1, by="ann", reason="worse after all", replaces="*")
    assert len({made.etag, moved.etag, back.etag}) == 3  # back at 1, but not unchanged
    assert filled.aliases.get(NAME, "production") == back
    assert filled.aliases.of(NAME) == [back]

    told = filled.aliases.moves(NAME, 10)
    assert [(m.from_version, m.to_version, m.moved_by, m.reason) for m in told] == [
        (3, 1, "ann", "worse after all"),
        (1, 3, "ben", "better"),
        (None, 1, "ann", "first"),
    ]
    assert [m.revision for m in told] == [3, 2, 1]
    assert filled.aliases.moves(NAME, 1) == told[:1]


def test_a_mover_must_have_seen_where_it_stands(filled: Registry) -> None:
    move = filled.aliases.move
    with pytest.raises(AliasConflictError, match="never made"):
        move(NAME, "production", 1, by="ann", replaces="production-1")
    made = move(NAME, "production", 1, by="ann", replaces=None)
    move(NAME, "production", 2, by="ben", replaces=made.etag)
    for seen in (made.etag, None):
        with pytest.raises(AliasConflictError, match="production-2"):
            move(NAME, "production", 3, by="ann", replaces=seen)
    assert filled.get(f"{NAME}@production").version == 2
    assert len(filled.aliases.moves(NAME, 10)) == 2


def test_an_alias_stands_for_published_versions_only(filled: Registry) -> None:
    for name, version in ((NAME, 4), ("nobody", 1)):
        with pytest.raises(UnknownModelError):
            filled.aliases.move(name, "production", version, by="ann", replaces=None)
    for alias in ("", "3", "Production", "a b"):
        with pytest.raises(RegistryNameError, match="accepted"):
            filled.aliases.move(NAME, alias, 1, by="ann", replaces=None)
    assert filled.aliases.of(NAME) == []


@pytest.mark.parametrize(
    ("replaces", "exists"), [(None, False), ("seen", True), ("*", True), ("*", False)]
)
def test_of_many_movers_one_wins_and_all_are_kept(
    filled: Registry, replaces: str | None, exists: bool
) -> None:
    if exists:
        made = filled.aliases.move(NAME, "production", 1, by="ann", replaces=None)
        replaces = made.etag if replaces == "seen" else replaces
    before = len(filled.aliases.moves(NAME, 100))
    won, lost = [], []

    def move(number: int) -> None:
        try:
            version = 1 + number % 3
            kept = filled.aliases.move(
                NAME, "production", version, by=str(number), replaces=replaces
            )
            won.append(kept.revision)
        except AliasConflictError:
            lost.append(number)

    threads = [threading.Thread(target=move, args=(number,)) for number in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60.0)
    assert len(won) == (6 if replaces == "*" else 1)
    assert len(won) + len(lost) == 6
    kept = filled.aliases.moves(NAME, 100)
    assert len(kept) == before + len(won)
    standing = filled.aliases.get(NAME, "production")
    assert standing is not None
    assert (kept[0].to_version, kept[0].revision) == (standing.version, standing.revision)
    steps = [(m.from_version, m.to_version) for m in reversed(kept)]
    assert all(a[1] == b[0] for a, b in itertools.pairwise(steps))  # no move is lost
