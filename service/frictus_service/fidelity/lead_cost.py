"""What a lead costs in rendering, from the table of `docs/lead.md`.

It is of the simulated rig: free strokes, every sensor used, compensated. `bench/lead.py`
measures it anew; a test holds these figures to the document.
"""

from typing import Final, NamedTuple

import numpy as np


class LeadCost(NamedTuple):
    """How far off the rendered finger and friction are at a lead.

    Attributes
    ----------
    lead_ms : float
        From handing a drive over to its playing.
    position_mm : float
        Rms of where the finger is rendered, against where it is.
    bands_db : float
        Friction at the screen against the target, in third octaves, dB rms.
    """

    lead_ms: float
    position_mm: float
    bands_db: float


MEASURED: Final = (
    LeadCost(2.0, 0.173, 0.454),
    LeadCost(5.0, 0.181, 0.448),
    LeadCost(10.0, 0.194, 0.480),
    LeadCost(15.0, 0.209, 0.486),
    LeadCost(20.0, 0.225, 0.493),
    LeadCost(30.0, 0.270, 0.532),
)
"""In the order of the lead."""


def lead_cost(lead_ms: float) -> LeadCost | None:
    """Return what a lead costs, linear between those measured; None beyond them.

    Parameters
    ----------
    lead_ms : float
        From handing a drive over to its playing.
    """
    leads_ms, positions_mm, bands_db = zip(*MEASURED, strict=True)
    if not leads_ms[0] <= lead_ms <= leads_ms[-1]:
        return None
    return LeadCost(
        lead_ms,
        float(np.interp(lead_ms, leads_ms, positions_mm)),
        float(np.interp(lead_ms, leads_ms, bands_db)),
    )
