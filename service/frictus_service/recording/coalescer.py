"""Blocks of 5 ms become messages of up to 100 ms; nothing that differs is put together."""

from typing import Final

import numpy as np

from frictus.block import MAX_SAMPLES, Block
from frictus_service.recording.samples import Samples

MESSAGE_S: Final = 0.1
"""Longest message, unless one block is longer; none has more than `MAX_SAMPLES`."""
UTC_NS: Final = 1_000_000
"""How far a block's UTC may be off the one before it plus its length: more is a step."""


class Coalescer:
    """Collects the blocks of one stream.

    Attributes
    ----------
    held_samples : int
        Samples waiting for company.
    """

    def __init__(self) -> None:
        self._held: list[Block] = []
        self.held_samples = 0

    def add(self, block: Block) -> list[Samples]:
        """Take a block and return the messages that are finished by it."""
        finished = []
        samples = block.data.shape[1]
        most = min(MESSAGE_S * block.sample_rate_hz, MAX_SAMPLES)
        if self._held and not (self._continues(block) and self.held_samples + samples <= most):
            finished += self.flush()
        self._held.append(block)
        self.held_samples += samples
        if self.held_samples + samples > most:
            finished += self.flush()  # another one like it would not fit
        return finished

    def flush(self) -> list[Samples]:
        """Return what is held, as one message or none."""
        held, self._held, self.held_samples = self._held, [], 0
        if not held:
            return []
        first = held[0]
        return [
            Samples(
                first.stream,
                first.run,
                first.sequence,
                len(held),
                first.first_sample,
                first.utc_ns,
                first.uncertainty_ns,
                first.sample_rate_hz,
                first.flags,
                np.concatenate([block.data for block in held], axis=1),
            )
        ]

    def _continues(self, block: Block) -> bool:
        last = self._held[-1]
        due_ns = last.utc_ns + 1e9 * last.data.shape[1] / last.sample_rate_hz
        return (
            block.run == last.run
            and block.sequence == last.sequence + 1
            and block.first_sample == last.first_sample + last.data.shape[1]
            and block.flags == last.flags
            and block.sample_rate_hz == last.sample_rate_hz
            and block.data.shape[0] == last.data.shape[0]
            and abs(block.utc_ns - due_ns) <= UTC_NS
        )
