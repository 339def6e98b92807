"""What must hold of a command is looked for only where it can be otherwise."""

import time
from typing import Any

import numpy as np
import pytest

from frictus.errors import RefusedError
from frictus.messages import LeaseRenewal, SceneRequest
from frictus.textures import Component, Region, Scene, Spectrum
from frictus_service.command_validation import (
    MAX_DIGITS,
    SHORT_BYTES,
    SLICED_BYTES,
    CommandValidator,
)
from frictus_service.config import Limits


def test_what_is_too_short_to_hold_too_much_is_not_counted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # Half of what a lease renewal took; meanwhile the block loop waits for the lock.
    counted: list[bytes] = []
    frombuffer = np.frombuffer

    def counting(payload: bytes, kind: Any) -> Any:
        counted.append(payload)
        return frombuffer(payload, kind)

    monkeypatch.setattr(np, "frombuffer", counting)
    utc_ns = time.time_ns()
    renewal = LeaseRenewal(client="ann", utc_ns=utc_ns).to_json()
    longer = renewal.ljust(MAX_DIGITS)
    for payload in (renewal, longer):
        CommandValidator(Limits()).read(LeaseRenewal, payload, utc_ns, SHORT_BYTES)
    assert counted == [longer]


@pytest.mark.parametrize("bytes_", [0, SLICED_BYTES])
def test_a_long_payload_is_read_as_strictly_as_a_short_one(bytes_: int) -> None:
    utc_ns = time.time_ns()
    texture = Spectrum(components=[Component(amplitude_n=0.25, hz=100.0)])
    scene = Scene(regions=[Region(texture=texture, x_mm=(1.0, 50.0), gain=0.5)])
    request = SceneRequest(client="ann", utc_ns=utc_ns, scene=scene)

    def read(old: bytes = b"", new: bytes = b"") -> SceneRequest:
        payload = request.to_json().replace(old, new).ljust(bytes_)
        return CommandValidator(Limits()).read(SceneRequest, payload, utc_ns, len(payload))

    assert read() == request
    for old, name in ((b"0.25", "amplitude_n"), (b"0.5", "gain"), (b"50.0", "x_mm")):
        for new in (b"true", b'"1"'):
            with pytest.raises(RefusedError, match=rf"{name}.*should be a valid number"):
                read(old, new)
