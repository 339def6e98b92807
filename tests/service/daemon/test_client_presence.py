"""Fallen tokens: the owner's is never lost, and who is gone does not keep what it arms."""

import threading

import pytest

from frictus_service.daemon.control import FALLEN, ClientPresence


def test_the_owner_is_found_among_a_thousand_fallen_tokens() -> None:
    vanished: list[str] = []
    presence = ClientPresence(vanished.append)
    names = [f"client{number}" for number in range(2 * FALLEN)]
    for name in names:
        presence.on_token(name, True)
    for name in names:
        presence.on_token(name, False)
    assert vanished == names


@pytest.mark.parametrize("back", [False, True])
def test_who_arms_with_a_fallen_token_must_show_it_again(
    back: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("frictus_service.daemon.control.CONFIRM_S", 0.01)
    vanished: list[str] = []
    twice = threading.Semaphore(0)

    def vanish(client: str) -> None:
        vanished.append(client)
        twice.release()

    presence = ClientPresence(vanish)
    presence.on_token("ann", False)
    presence.on_armed("ann")
    presence.on_armed("ben")
    if back:
        presence.on_token("ann", True)
        presence.on_token("cid", False)
        presence.on_armed("cid")
    for _ in range(3 if back else 2):
        assert twice.acquire(timeout=10.0)
    assert vanished == (["ann", "cid", "cid"] if back else ["ann", "ann"])
