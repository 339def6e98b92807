"""A texture stream whose updates are sent by one thread and that another closes."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import zenoh

from frictus.errors import LinkError
from frictus.keys import RigKeys
from frictus.messages import Reply
from frictus.stream import TextureStream


class Closing:
    """Friction during whose reading another thread closes the stream."""

    def __init__(self, stream: TextureStream) -> None:
        self._stream = stream

    def __array__(self, *_: Any, **options: Any) -> Any:
        self._stream.close()
        return np.zeros(2, np.float32)


def test_a_stream_that_is_closed_while_it_sends_says_so() -> None:
    config = zenoh.Config()
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("listen/endpoints", "[]")
    with zenoh.open(config) as session:
        caller: Any = SimpleNamespace(
            session=session,
            keys=RigKeys("lab", "rig1"),
            call=lambda name, **_: Reply(ok=True, ticket=1),
        )
        status: Any = SimpleNamespace(newest=lambda: None)
        stream = TextureStream(caller, status, 0.1)
        with pytest.raises(LinkError, match="not sent"):
            stream.send(Closing(stream), period_mm=2.0)
        assert (stream.closed, stream.sent) == (True, 0)
