"""What processes do with the garbage collector, which stops all of their threads."""

import gc

import pytest

from frictus_service.processes import existing_objects_frozen, garbage_collection_off

pytestmark = pytest.mark.usefixtures("nothing_frozen")


class Node:
    """Something that refers to itself, and that only a collection ends."""

    def __init__(self) -> None:
        self.itself = self


def test_what_existed_is_in_no_collection_and_what_comes_is() -> None:
    kept = Node()
    with existing_objects_frozen():
        looked_at = gc.get_objects()
        assert not any(found is kept for found in looked_at)
        new = Node()
        assert any(found is new for found in gc.get_objects())
        assert gc.isenabled()
        del new
        assert gc.collect() >= 1
    assert any(found is kept for found in gc.get_objects())


def test_what_was_frozen_before_stays_so() -> None:
    kept = Node()
    gc.freeze()
    with existing_objects_frozen():
        pass
    assert not any(found is kept for found in gc.get_objects())


def _fail_without_collections() -> None:
    with garbage_collection_off():
        assert not gc.isenabled()
        raise KeyError


def test_collections_begin_again_after_whatever_happened() -> None:
    with pytest.raises(KeyError):
        _fail_without_collections()
    assert gc.isenabled()
    assert gc.get_freeze_count() == 0
