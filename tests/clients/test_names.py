"""Names of recordings, which become names of files."""

import pytest
from pydantic import ValidationError

from frictus.messages import RecordRequest


def asked(name: str) -> RecordRequest:
    return RecordRequest(client="c", utc_ns=0, ttl_ms=100, name=name)


@pytest.mark.parametrize("name", ["a", "P01.2", ".hidden", "console", "com", "nul1", "a..b"])
def test_a_file_can_bear_it(name: str) -> None:
    assert asked(name).name == name


@pytest.mark.parametrize("name", [".", "..", "a.", "a..", "CON", "nul", "Nul.x", "com1.a.b"])
def test_no_file_can_bear_it(name: str) -> None:
    with pytest.raises(ValidationError, match=r"ends with a dot|device on Windows"):
        asked(name)
