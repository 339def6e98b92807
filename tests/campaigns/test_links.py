"""A link that is made bad: what it does to bytes, and what a client behind it does to a rig."""

import contextlib
import socket
import socketserver
import threading
import time
from collections.abc import Iterator

import pytest
from tests.campaigns import links
from tests.campaigns.proxy import RETRANSMISSION_S, Impairment, Proxy

SEED = 5
ANSWER_S = 60.0


class Echo(socketserver.BaseRequestHandler):
    """Sends back what comes."""

    def handle(self) -> None:
        with contextlib.suppress(ConnectionError):
            while data := self.request.recv(65_536):
                self.request.sendall(data)


@pytest.fixture
def echo_port() -> Iterator[int]:
    socketserver.ThreadingTCPServer.daemon_threads = True
    with socketserver.ThreadingTCPServer(("127.0.0.1", 0), Echo) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield server.server_address[1]
        server.shutdown()
        thread.join()


def sent_and_back(connection: socket.socket, data: bytes) -> float:
    """Send something through an echo; return how long it took to be back whole, s."""
    began_s = time.monotonic()
    connection.sendall(data)
    back = b""
    while len(back) < len(data):
        back += connection.recv(65_536)
    assert back == data
    return time.monotonic() - began_s


@pytest.mark.parametrize(
    ("impairment", "least_s"),
    [
        (Impairment(), 0.0),
        (Impairment(delay_s=0.05), 0.1),
        (Impairment(delay_s=0.01, jitter_s=0.02), 0.02),
        (Impairment(loss=1.0), 2.0 * RETRANSMISSION_S),
        (Impairment(rate_bytes_s=5e5), 0.2),
    ],
)
def test_bytes_come_in_order_and_no_sooner(
    echo_port: int, impairment: Impairment, least_s: float
) -> None:
    data = bytes(range(250)) * 400
    with (
        Proxy(echo_port, impairment, SEED) as proxy,
        socket.create_connection(("127.0.0.1", proxy.port), ANSWER_S) as connection,
    ):
        assert sent_and_back(connection, data) >= least_s


def test_a_stall_holds_back_and_a_cut_breaks(echo_port: int) -> None:
    with Proxy(echo_port, Impairment(), SEED) as proxy:
        place = ("127.0.0.1", proxy.port)
        with socket.create_connection(place, ANSWER_S) as connection:
            sent_and_back(connection, b"before")
            proxy.stall()
            threading.Timer(0.3, proxy.mend).start()
            assert sent_and_back(connection, b"held") > 0.2
            proxy.cut()
            with contextlib.suppress(ConnectionError):
                assert connection.recv(1) == b""
        with socket.create_connection(place, ANSWER_S) as refused:
            with contextlib.suppress(ConnectionError):
                assert refused.recv(1) == b""
        proxy.mend()
        with socket.create_connection(place, ANSWER_S) as connection:
            sent_and_back(connection, b"again")


@pytest.mark.campaign
@pytest.mark.timeout(600)
def test_a_client_behind_a_link_that_stalls() -> None:
    with contextlib.closing(links.Campaign()) as campaign:
        line = campaign.run("stall of 2 s/0", SEED)
    assert line["failures"] == []
    assert 0.0 < line["zero_ms"]
