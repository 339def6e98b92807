"""Names of recordings, which become names of files, and of those who send commands."""

import pytest
from pydantic import ValidationError

from frictus.messages import RecordRequest, Request
from frictus.names import MAX_NAME, name_in


def asked(name: str) -> RecordRequest:
    return RecordRequest(client="c", utc_ns=0, ttl_ms=100, name=name)


@pytest.mark.parametrize("name", ["a", "P01.2", ".hidden", "console", "com", "nul1", "a..b"])
def test_a_file_can_bear_it(name: str) -> None:
    assert asked(name).name == name


@pytest.mark.parametrize("name", [".", "..", "a.", "a..", "CON", "nul", "Nul.x", "com1.a.b"])
def test_no_file_can_bear_it(name: str) -> None:
    with pytest.raises(ValidationError, match=r"ends with a dot|device on Windows"):
        asked(name)


HOSTILE = ["\x1b[31mann", "ann\nrig1 tripped", "\u202enna", "\x00", "a b", ""]


@pytest.mark.parametrize("name", HOSTILE)
def test_a_client_has_a_name_that_steers_no_terminal(name: str) -> None:
    with pytest.raises(ValidationError, match=r"client[\s\S]*(ASCII letters|at least 1)"):
        Request(client=name, utc_ns=0)
    assert name_in(name.encode()) == ""
    assert name_in(b"ann.page-7c2e41") == "ann.page-7c2e41"
    assert name_in(b"a" * (MAX_NAME + 1)) == ""


@pytest.mark.parametrize("participant", HOSTILE[:4])
def test_a_pseudonym_is_one_that_a_study_can_hold(participant: str) -> None:
    with pytest.raises(ValidationError, match="no control characters"):
        RecordRequest(client="c", utc_ns=0, name="a", participant=participant)
    asked = RecordRequest(client="c", utc_ns=0, name="a", participant="Zoë 01")
    assert asked.participant == "Zoë 01"
