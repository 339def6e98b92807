"""What a rig under test bears of a machine that does other things beside it."""

from typing import Final

from frictus_service.config import Limits

PATIENT: Final = Limits(freeze_ms=5_000, missed_deadlines=1_000)
"""A busy machine trips no rig by them. What the usual ones promise is tested with those."""
PATIENT_LEASE_MS: Final = 5_000
"""Of a client or a page: what renews it waits for cores as the rig does."""
