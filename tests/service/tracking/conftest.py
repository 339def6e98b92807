"""What a finger felt, made once for each module."""

import pytest
from tests.service.tracking.played import PERSON, played

from frictus_hardware.physics.twin import Signals


@pytest.fixture(scope="module")
def felt(module_seed: int) -> Signals:
    """What PERSON feels in 12 s."""
    return played(PERSON, 12.0, module_seed)
