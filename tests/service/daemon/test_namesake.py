"""Two rigs of one name at one router."""

from frictus.calls import present_rigs
from frictus.keys import RigKeys
from frictus.session import open_router, open_session
from frictus_service.daemon.rig import say_if_present
from frictus_service.processes import free_endpoint


def test_a_rig_says_that_another_has_its_name() -> None:
    endpoint = free_endpoint()
    here, elsewhere = RigKeys("lab", "rig1"), RigKeys("lab", "rig2")
    said: list[str] = []
    with (
        open_router(endpoint),
        open_session(endpoint) as first,
        open_session(endpoint) as second,
    ):
        token = first.liveliness().declare_token(here.alive)
        while here not in present_rigs(second, "lab"):
            pass
        say_if_present(second, elsewhere, said.append)
        assert said == []
        say_if_present(second, here, said.append)
        token.undeclare()  # type: ignore[no-untyped-call]
    assert len(said) == 1
    assert "another rig rig1 at lab is present" in said[0]
    assert "`rig` of the configuration" in said[0]
