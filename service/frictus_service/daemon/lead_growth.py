"""How the lead grows after underruns: at the next arming, never while there is output.

A lead that is too short for the machine interrupts the texture again and again; one that is
longer than needed renders the finger where it no longer is. So it begins short, and grows by
what was missing.
"""


def grown_lead(
    lead_samples: int, missing_samples: int, block_samples: int, max_lead_samples: int
) -> int:
    """Return the lead that would have held out, in whole blocks more, within the longest.

    Parameters
    ----------
    lead_samples : int
        In force when samples were missing.
    missing_samples : int
        The longest gap of the output; 0: not known, and one block is added.
    block_samples : int
        Samples of one block.
    max_lead_samples : int
        What the backend accepts; not above `lead_samples`: the lead is fixed.
    """
    blocks = max(1, -(-missing_samples // block_samples))
    return max(lead_samples, min(lead_samples + blocks * block_samples, max_lead_samples))


class LeadGrowth:
    """Remembers the longest gap of the output since the lead was last looked at.

    Parameters
    ----------
    block_samples : int
        Samples of one block.
    """

    def __init__(self, block_samples: int) -> None:
        self._block_samples = block_samples
        self._in_a_row = 0
        self._longest: int | None = None

    def note(self, missing_samples: int) -> None:
        """Take in a block that was handed over while the rig was armed.

        Parameters
        ----------
        missing_samples : int
            How many of its samples came too late to play; blocks in a row make one gap.
        """
        if not missing_samples:
            self._in_a_row = 0
            return
        self._in_a_row += missing_samples
        self._longest = max(self._in_a_row, self._longest or 0)

    def note_run_dry(self) -> None:
        """Take note that the output ran dry and stopped the device; how long is not known."""
        self._in_a_row = 0
        self._longest = self._longest or 0

    def wanted(self, lead_samples: int, max_lead_samples: int) -> int:
        """Return the lead for the next arming.

        Parameters
        ----------
        lead_samples, max_lead_samples : int
            In force, and the longest that the backend accepts.
        """
        if self._longest is None:
            return lead_samples
        return grown_lead(lead_samples, self._longest, self._block_samples, max_lead_samples)

    def forget(self) -> None:
        """Forget what was missing: the lead is what it takes now."""
        self._longest, self._in_a_row = None, 0
