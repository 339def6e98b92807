"""What must hold of a command is looked for only where it can be otherwise."""

import time
from typing import Any

import numpy as np
import pytest

from frictus.messages import LeaseRenewal
from frictus_service.command_validation import MAX_DIGITS, SHORT_BYTES, CommandValidator
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
