"""What is in a recording, and whether all of it is sound."""

from dataclasses import asdict, dataclass, field
from typing import Any

from frictus_service.recording.notes import (
    STREAM_NAMES,
    EndNote,
    GapNote,
    PresenceNote,
    RecordingInfo,
)
from frictus_service.recording.reader import Ending, Item, RecordingReader, State
from frictus_service.recording.samples import Samples


@dataclass(slots=True)
class StreamSummary:
    """What there is of a stream, and what the gaps say is missing.

    Attributes
    ----------
    blocks, samples : int
        How many.
    seconds : float
        Of samples.
    gaps, lost_blocks, lost_samples : int
        How many, as the gaps say.
    """

    blocks: int = 0
    samples: int = 0
    seconds: float = 0.0
    gaps: int = 0
    lost_blocks: int = 0
    lost_samples: int = 0


@dataclass(frozen=True, slots=True)
class RecordingSummary:
    """What a whole reading found.

    Attributes
    ----------
    info : RecordingInfo
        Rig, name, participant and software.
    ending : Ending
        How far it could be read.
    streams : dict of name to StreamSummary
        Of each stream.
    states : dict of topic to number of messages
        Of each topic of state.
    gaps : tuple of GapNote
        In the order of the file.
    presence : tuple of PresenceNote
        When the rig came and went.
    end : EndNote or None
        None where the recording was torn.
    faults : tuple of str
        What contradicts itself; a recorder writes none.
    """

    info: RecordingInfo
    ending: Ending
    streams: dict[str, StreamSummary]
    states: dict[str, int]
    gaps: tuple[GapNote, ...]
    presence: tuple[PresenceNote, ...]
    end: EndNote | None
    faults: tuple[str, ...]

    @property
    def sound(self) -> bool:
        """Whether the file is complete and says one thing; gaps it names are no fault of it."""
        return self.ending.complete and not self.faults

    def fields(self) -> dict[str, Any]:
        """Return it for JSON."""
        return {
            "sound": self.sound,
            "ending": {**asdict(self.ending), "lost_s": self.ending.lost_s},
            "info": self.info.model_dump(mode="json", by_alias=True),
            "streams": {name: asdict(one) for name, one in self.streams.items()},
            "states": self.states,
            "gaps": [gap.model_dump(mode="json") for gap in self.gaps],
            "presence": [note.model_dump(mode="json") for note in self.presence],
            "end": None if self.end is None else self.end.model_dump(mode="json"),
            "faults": list(self.faults),
        }


def summarise(reader: RecordingReader) -> RecordingSummary:
    """Read a recording from beginning to end.

    Parameters
    ----------
    reader : RecordingReader
        An open recording.
    """
    tally = _Tally()
    for item in reader.items():
        tally.add(item)
    if tally.end is not None:
        tally.check_totals(tally.end)
    return RecordingSummary(
        reader.info,
        reader.ending,
        tally.streams,
        tally.states,
        tuple(tally.gaps),
        tuple(tally.presence),
        tally.end,
        tuple(tally.faults),
    )


@dataclass(slots=True)
class _Tally:
    streams: dict[str, StreamSummary] = field(default_factory=dict)
    states: dict[str, int] = field(default_factory=dict)
    gaps: list[GapNote] = field(default_factory=list)
    presence: list[PresenceNote] = field(default_factory=list)
    end: EndNote | None = None
    faults: list[str] = field(default_factory=list)
    _last: dict[str, Samples] = field(default_factory=dict)
    _explained: set[str] = field(default_factory=set)

    def add(self, item: Item) -> None:
        match item:
            case Samples():
                self._add_samples(item)
            case State():
                self.states[item.topic] = self.states.get(item.topic, 0) + 1
            case GapNote():
                self._add_gap(item)
            case PresenceNote():
                self.presence.append(item)
            case EndNote():
                self.end = item

    def _add_samples(self, samples: Samples) -> None:
        name = STREAM_NAMES[samples.stream]
        last = self._last.get(name)
        follows = last is None or (
            samples.run == last.run
            and samples.first_sequence == last.first_sequence + last.blocks
            and samples.first_sample == last.end_sample
        )
        if not follows and name not in self._explained:
            self.faults.append(
                f"{name}: block {samples.first_sequence} of run {samples.run} does not follow "
                "what stands before it, and no gap says so"
            )
        self._explained.discard(name)
        self._last[name] = samples
        summary = self.streams.setdefault(name, StreamSummary())
        summary.blocks += samples.blocks
        summary.samples += samples.data.shape[1]
        summary.seconds += samples.duration_s

    def _add_gap(self, gap: GapNote) -> None:
        self.gaps.append(gap)
        if gap.stream not in STREAM_NAMES.values():
            return
        self._explained.add(gap.stream)
        summary = self.streams.setdefault(gap.stream, StreamSummary())
        summary.gaps += 1
        summary.lost_blocks += gap.missing_blocks
        summary.lost_samples += gap.missing_samples

    def check_totals(self, end: EndNote) -> None:
        """Compare what was read with what the recorder counted."""
        for name, total in end.streams.items():
            found = self.streams.get(name, StreamSummary())
            if (found.blocks, found.samples) != (total.blocks, total.samples):
                self.faults.append(
                    f"{name}: {found.blocks} blocks of {found.samples} samples were read, the "
                    f"recorder wrote {total.blocks} of {total.samples}"
                )
