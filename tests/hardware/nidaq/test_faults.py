"""The fault table: every code to its kind, none without a line of the configuration."""

import pytest

from frictus_hardware.errors import (
    ConfigError,
    DeviceLostError,
    HardwareError,
    LinkLostError,
    StreamLostError,
    TransientError,
    UnderrunError,
)
from frictus_hardware.nidaq.driver import UnlistedFaultError, fault_of_code, fault_of_status

ROWS: list[tuple[type[HardwareError], list[int]]] = [
    (ConfigError, [-200220, -200561]),
    (TransientError, [-200284, -200292]),
    (StreamLostError, [-200279, -200361]),
    (UnderrunError, [-200290, -200018, -200621]),
    (DeviceLostError, [-88709, -88710, -50405, -200045, -200088]),
]


@pytest.mark.parametrize(
    ("kind", "code"), [(kind, code) for kind, codes in ROWS for code in codes]
)
def test_every_code_of_the_table_is_typed(kind: type[HardwareError], code: int) -> None:
    fault = fault_of_code(code, "output = 'ao0'", "What the driver says.\n\nProperty: no")
    assert type(fault) is kind
    assert "output = 'ao0'" in str(fault)
    assert str(code) in str(fault)
    assert "What the driver says." in str(fault)
    assert "Property" not in str(fault)


@pytest.mark.parametrize("code", [-1, -200000, -209999])
def test_a_code_that_is_not_in_the_table_says_so_and_counts_as_a_lost_device(code: int) -> None:
    fault = fault_of_code(code, "reading", "")
    assert type(fault) is UnlistedFaultError
    assert fault.kind == "device_lost"
    assert "not in the fault table" in str(fault)


@pytest.mark.parametrize(
    ("status", "kind"),
    [
        ("UNAVAILABLE", LinkLostError),
        ("DEADLINE_EXCEEDED", LinkLostError),
        ("UNAUTHENTICATED", ConfigError),
        ("UNIMPLEMENTED", ConfigError),
        ("INTERNAL", UnlistedFaultError),
    ],
)
def test_every_status_of_the_link_is_typed(status: str, kind: type[HardwareError]) -> None:
    fault = fault_of_status(status, "address = 'rig-pc:31763'", "")
    assert type(fault) is kind
    assert "rig-pc:31763" in str(fault)
    assert status in str(fault)
