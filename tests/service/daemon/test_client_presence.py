"""Tokens: the owner's is never lost, and who shows none does not keep what it arms."""

import queue
import threading

import pytest

from frictus_service.daemon.control import ClientPresence


def test_the_owner_is_found_among_thousands_of_fallen_tokens() -> None:
    vanished: list[str] = []
    presence = ClientPresence(vanished.append)
    names = [f"client{number}" for number in range(8_192)]
    for name in names:
        presence.on_token(name, True)
    for name in names:
        presence.on_token(name, False)
    assert vanished == names


@pytest.mark.parametrize("tokens", [(), (False,), (True, False), (False, True), (True,)])
def test_who_arms_must_show_a_token(
    tokens: tuple[bool, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("frictus_service.daemon.control.CONFIRM_S", 0.01)
    vanished: queue.SimpleQueue[str] = queue.SimpleQueue()
    presence = ClientPresence(vanished.put)
    for present in tokens:
        presence.on_token("ann", present)
        if not present:
            assert vanished.get_nowait() == "ann"
    for client in ("ann", "last"):
        presence.on_armed(client)
    expected = ["last"] if tokens[-1:] == (True,) else ["ann", "last"]
    # Two timers keep no order.
    assert sorted(vanished.get(timeout=10.0) for _ in expected) == expected
    assert vanished.empty()


def test_a_token_that_comes_in_time_is_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("frictus_service.daemon.control.CONFIRM_S", 0.2)
    vanished: list[str] = []
    confirmed = threading.Event()

    def vanish(client: str) -> None:
        vanished.append(client)
        confirmed.set()

    presence = ClientPresence(vanish)
    for client in ("ann", "ben"):
        presence.on_armed(client)
    presence.on_token("ann", True)
    assert confirmed.wait(10.0)
    assert vanished == ["ben"]
