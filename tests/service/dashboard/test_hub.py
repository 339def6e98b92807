"""Who is present, also after nobody has looked for a while."""

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest

from frictus.client import Presence, RigName
from frictus_service.api.dashboard import hub as hub_module
from frictus_service.api.dashboard.hub import Hub

WAIT_S = 30.0


class Viewer:
    """One who watches no rig."""

    wanted: frozenset[tuple[str, str]] = frozenset()


class Changes:
    """What a feed brings; what was taken is told."""

    def __init__(self) -> None:
        self.waiting: list[Presence] = []
        self.taken = asyncio.Event()

    def bring(self, name: str, present: bool) -> None:
        self.waiting.append(Presence(RigName("lab", name), present))
        self.taken.clear()

    def drain(self) -> list[Presence]:
        found, self.waiting = self.waiting, []
        if found:
            self.taken.set()
        return found

    def close(self) -> None:
        pass


def test_who_goes_while_nobody_looks_is_not_shown_afterwards(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(hub_module, "TEND_S", 0.0)

    async def scene() -> None:
        changes = Changes()
        client = SimpleNamespace(
            presence=lambda site: changes,
            session=SimpleNamespace(info=SimpleNamespace(transports=lambda: ["router"])),
        )
        link: Any = SimpleNamespace(site="lab", client=lambda: client)
        hub = Hub(link, 500)
        changes.bring("rig1", True)
        changes.bring("rig2", True)
        async with asyncio.timeout(WAIT_S):
            with hub.joined(Viewer(), "ann"):
                await changes.taken.wait()
                assert list(hub.rigs) == ["rig1", "rig2"]
            changes.bring("rig1", False)
            await changes.taken.wait()  # nobody looks, and nobody pumps
        assert list(hub.rigs) == ["rig2"]
        await hub.close()

    asyncio.run(scene())
