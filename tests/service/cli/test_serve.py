"""What `frictus serve` says before anything runs."""

import socket

import pytest

from frictus_service.cli.serve import where_to_look
from frictus_service.config import ApiConfig, Token

TOKENS = (Token(name="ann", scopes=("read",), value="a-token-of-a-test"),)


@pytest.mark.parametrize(
    ("host", "named"),
    [
        ("127.0.0.1", "127.0.0.1"),
        ("::1", "[::1]"),
        ("192.0.2.2", "192.0.2.2"),
        ("0.0.0.0", socket.gethostname()),  # no browser opens that one
        ("::", socket.gethostname()),
    ],
)
def test_the_page_is_said_at_an_address_that_can_be_opened(host: str, named: str) -> None:
    said = where_to_look(ApiConfig(host=host, port=8420, tokens=TOKENS))
    assert f"http://{named}:8420/ " in said
    assert f"http://{named}:8420/docs" in said
