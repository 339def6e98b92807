"""A lab with real certificates: a router with roles, a rig, and people."""

import datetime
import queue
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
import zenoh
import zenoh.ext
from zenoh.handlers import Callback

import frictus
from frictus.keys import CALLS, RigKeys, Topic, Topics
from frictus.messages import Reply
from frictus.session import declare_latest_publisher, is_read, open_router, open_session
from frictus.tls import Tls
from frictus_service.processes import free_port
from frictus_service.security.authority import Issued, issue, make_authority
from frictus_service.security.files import AUTHORITY, members_in, write
from frictus_service.security.members import Member
from frictus_service.security.router import access_control

DAY = datetime.timedelta(days=1)
WAIT_S = 10.0


@dataclass
class Authority:
    """An authority and what it signed, in a folder."""

    folder: Path
    name: str = "lab"
    issued: Issued = field(init=False)

    def __post_init__(self) -> None:
        self.issued = make_authority(self.name, datetime.datetime.now(datetime.UTC), DAY)
        write(self.issued, self.folder, AUTHORITY)

    @property
    def file(self) -> Path:
        return self.folder / "ca.pem"

    def sign(
        self,
        common_name: str,
        hosts: Sequence[str] = (),
        age: datetime.timedelta = datetime.timedelta(),
        lasts: datetime.timedelta = DAY,
        folder: Path | None = None,
    ) -> Tls:
        member = Member.of(common_name)
        begins = datetime.datetime.now(datetime.UTC) - age
        made = issue(self.issued, member, hosts, begins, lasts)
        return Tls(self.file, write(made, folder or self.folder, member.stem)[0])


class SecuredRig:
    """Answers every call with yes and notes what reaches it."""

    def __init__(self, router: str, tls: Tls, keys: RigKeys) -> None:
        self.keys = keys
        self.reached: queue.Queue[tuple[str, bytes]] = queue.Queue()
        self.session = open_session(router, tls=tls)
        self._declared: list[Any] = [
            self.session.declare_queryable(keys.call(call), Callback(self._answer))
            for call in CALLS
        ]
        for topic in (Topics.TEXTURE, Topics.LEASE, Topics.POINTER):
            self._declared.append(
                self.session.declare_subscriber(keys.of(topic), Callback(self._note))
            )
        self.status = declare_latest_publisher(
            self.session, keys.of(Topics.STATUS), Topics.STATUS
        )
        self.status.put(b"first")
        self._declared.append(self.session.liveliness().declare_token(keys.alive))

    def _note(self, sample: zenoh.Sample) -> None:
        self.reached.put((str(sample.key_expr), sample.payload.to_bytes()))

    def _answer(self, query: zenoh.Query) -> None:
        with query:
            self.reached.put((str(query.key_expr), b""))
            query.reply(query.key_expr, Reply(ok=True).to_json())

    def reached_until(self, key: str) -> list[tuple[str, bytes]]:
        """What reached the rig up to something under `key`, which is the last."""
        reached: list[tuple[str, bytes]] = []
        while not reached or reached[-1][0] != key:
            reached.append(self.reached.get(timeout=WAIT_S))
        return reached


@dataclass
class Lab:
    """A router that knows its members, and the certificates of some."""

    endpoint: str
    authority: Authority
    rig: Tls
    other_rig: Tls
    controller: Tls
    observer: Tls
    stranger: Tls
    """Signed by the authority, and unknown to the router."""
    keys: RigKeys = field(default_factory=lambda: RigKeys("lab", "rig1"))


@pytest.fixture(scope="session")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lab]:
    authority = Authority(tmp_path_factory.mktemp("pki"))
    outside = tmp_path_factory.mktemp("outside")
    lab = Lab(
        f"tls/127.0.0.1:{free_port()}",
        authority,
        rig=authority.sign("rig:lab/rig1"),
        other_rig=authority.sign("rig:lab/rig2"),
        controller=authority.sign("controller:alice"),
        observer=authority.sign("observer:bob"),
        stranger=authority.sign("controller:mallory", folder=outside),
    )
    router = authority.sign("router:hall", ["127.0.0.1"])
    access = access_control(members_in(authority.folder))
    with open_router(lab.endpoint, router, access):
        yield lab


@pytest.fixture
def rig(lab: Lab) -> Iterator[SecuredRig]:
    rig = SecuredRig(lab.endpoint, lab.rig, lab.keys)
    yield rig
    rig.session.close()  # type: ignore[no-untyped-call]


@pytest.fixture
def other_rig(lab: Lab) -> Iterator[SecuredRig]:
    rig = SecuredRig(lab.endpoint, lab.other_rig, RigKeys("lab", "rig2"))
    yield rig
    rig.session.close()  # type: ignore[no-untyped-call]


Join = Callable[[Tls], frictus.Client]


@pytest.fixture
def join(lab: Lab, rig: SecuredRig) -> Iterator[Join]:
    """Connects with a certificate to the router of the rig."""
    clients: list[frictus.Client] = []

    def connected(tls: Tls) -> frictus.Client:
        clients.append(frictus.connect(lab.endpoint, tls=tls))
        return clients[-1]

    yield connected
    for client in clients:
        client.close()


class Ear:
    """Hears what a session is sent under a key."""

    def __init__(self, session: zenoh.Session, key: str) -> None:
        self.heard: queue.Queue[bytes] = queue.Queue()
        self._subscriber = session.declare_subscriber(key, Callback(self._hear))

    def _hear(self, sample: zenoh.Sample) -> None:
        self.heard.put(sample.payload.to_bytes())

    def attune(self, session: zenoh.Session, key: str) -> None:
        """Have `session` say something until it is heard: from then on, whatever it says is.

        What is heard first may have left before its sender knew of this ear; what the sender
        says next is dropped then, until it knows.
        """
        publisher = session.declare_publisher(key)
        for attempt in range(200):
            said = b"hear %d" % attempt
            known = is_read(publisher)
            publisher.put(said)
            try:
                while self.heard.get(timeout=0.05) != said:
                    continue
            except queue.Empty:
                continue
            if known:
                publisher.undeclare()  # type: ignore[no-untyped-call]
                return
        raise AssertionError("nothing was heard")

    def until(self, payload: bytes) -> list[bytes]:
        """Everything heard up to `payload`."""
        heard = [self.heard.get(timeout=WAIT_S)]
        while heard[-1] != payload:
            heard.append(self.heard.get(timeout=WAIT_S))
        return heard


def shout(session: zenoh.Session, keys: RigKeys, topic: Topic, payload: bytes) -> None:
    """Put with the priority of commands, so that what follows on the link stays behind."""
    options: dict[str, Any] = {
        "priority": zenoh.Priority.REAL_TIME,
        "congestion_control": zenoh.CongestionControl.BLOCK,
        "express": True,
    }
    session.put(keys.of(topic), payload, **options)
