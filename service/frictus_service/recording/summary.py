"""What is in a recording, whether all of it is sound, and a finished file from a torn one."""

import struct
from dataclasses import asdict, dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.writer import MCAP0_MAGIC

from frictus.messages import ModelState, RigStatus
from frictus.model import Compensation
from frictus_service.recording.reader import Ending, Item, RecordingReader, State
from frictus_service.recording.recording import SUFFIX
from frictus_service.recording.records import (
    END,
    STREAM_NAMES,
    EndNote,
    GapNote,
    PresenceNote,
    RecordingInfo,
)
from frictus_service.recording.samples import Samples


@dataclass(frozen=True, slots=True)
class Shelved:
    """One recording of the folder.

    Attributes
    ----------
    path : Path
        Of the file.
    size : int
        Bytes.
    modified_s : float
        UTC, s since 1970.
    finished : bool
        Ended in order; otherwise it is being written, or was torn.
    """

    path: Path
    size: int
    modified_s: float
    finished: bool


def shelved(folder: Path) -> list[Shelved]:
    """Return the recordings of a folder, the newest first; none where there is no folder.

    What is no file, such as a folder or a pipe that is called like one, is left out.
    """
    found = []
    for path in filter(Path.is_file, folder.glob(f"*{SUFFIX}")):
        try:
            found.append(shelf_entry(path))
        except FileNotFoundError:
            continue  # somebody has just moved it
    return sorted(found, key=lambda one: one.modified_s, reverse=True)


def shelf_entry(path: Path) -> Shelved:
    """Return what there is to know of a recording without reading it.

    Parameters
    ----------
    path : Path
        Of the file.

    Raises
    ------
    FileNotFoundError
    """
    stat = path.stat()
    return Shelved(path, stat.st_size, stat.st_mtime, is_finished(path))


def is_finished(path: Path) -> bool:
    """Return whether a file ends as a finished recording does; its checksums are not looked at.

    Parameters
    ----------
    path : Path
        Of the file.
    """
    length = len(MCAP0_MAGIC)
    with path.open("rb") as file:
        size = file.seek(0, 2)
        file.seek(max(0, size - length))
        return size > length and file.read() == MCAP0_MAGIC


@lru_cache(maxsize=1_024)
def _length_s(path: Path, size: int, modified_s: float) -> float | None:
    """Return a file's length; `size` and `modified_s` make what is kept that of this file."""
    try:
        with path.open("rb") as file:
            reader = make_reader(file)
            summary = reader.get_summary()
            for _, _, end in reader.iter_messages(topics=[END]):
                if (seconds := EndNote.model_validate_json(end.data).seconds) is not None:
                    return seconds
    except (OSError, McapError, ValueError, struct.error):
        return None
    # Of an older recorder. By the clock, which somebody may have set meanwhile.
    statistics = None if summary is None else summary.statistics
    if summary is None or statistics is None or statistics.message_count == 0:
        return None
    # The first states say when they came into force, which may be days before.
    began_ns = [one.log_time for one in summary.attachment_indexes]
    start_ns = max([statistics.message_start_time, *began_ns])
    return 1e-9 * max(0, statistics.message_end_time - start_ns)


def length_s(one: Shelved) -> float | None:
    """Return the seconds from the beginning to the last message, as the file itself says.

    Parameters
    ----------
    one : Shelved
        Of `shelved`.

    Returns
    -------
    float or None
        None where it is not finished, is empty, or cannot be read.
    """
    return _length_s(one.path, one.size, one.modified_s) if one.finished else None


def unfinished(folder: Path) -> Path | None:
    """Return the newest recording of a folder if it was torn, else None."""
    newest = next(iter(shelved(folder)), None)
    return None if newest is None or newest.finished else newest.path


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
class CompensationChange:
    """From when on a compensation mode was in force.

    Attributes
    ----------
    utc_ns : int
        Of the first status that says so; at most one publication later than the change.
    compensation : Compensation
        The mode.
    """

    utc_ns: int
    compensation: Compensation


@dataclass(frozen=True, slots=True)
class RecordedModel:
    """From when on a friction model was in force.

    Attributes
    ----------
    utc_ns : int
        When the rig published it; at most one publication later than the change.
    etag : str
        Of the model.
    adapted_from : str or None
        Etag of the model that it was adapted from while it played; None: it was set.
    reason : str
        Why it was adapted.
    """

    utc_ns: int
    etag: str
    adapted_from: str | None
    reason: str


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
    compensations : tuple of CompensationChange
        The mode at the beginning, and each change of it.
    models : tuple of RecordedModel
        The friction model at the beginning, and each change of it.
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
    compensations: tuple[CompensationChange, ...]
    models: tuple[RecordedModel, ...]
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
            "compensation": [
                {"utc_ns": change.utc_ns, **change.compensation.model_dump()}
                for change in self.compensations
            ],
            "models": [asdict(model) for model in self.models],
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
        tuple(tally.compensations),
        tuple(tally.models),
        tuple(tally.gaps),
        tuple(tally.presence),
        tally.end,
        tuple(tally.faults),
    )


@dataclass(slots=True)
class _Tally:
    streams: dict[str, StreamSummary] = field(default_factory=dict)
    states: dict[str, int] = field(default_factory=dict)
    compensations: list[CompensationChange] = field(default_factory=list)
    models: list[RecordedModel] = field(default_factory=list)
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
                if isinstance(item.message, RigStatus):
                    self._note_compensation(item.utc_ns, item.message.compensation)
                elif isinstance(item.message, ModelState):
                    self._note_model(item.utc_ns, item.message)
            case GapNote():
                self._add_gap(item)
            case PresenceNote():
                self.presence.append(item)
            case EndNote():
                self.end = item

    def _note_compensation(self, utc_ns: int, found: Compensation) -> None:
        if not self.compensations or self.compensations[-1].compensation != found:
            self.compensations.append(CompensationChange(utc_ns, found))

    def _note_model(self, utc_ns: int, found: ModelState) -> None:
        if not self.models or self.models[-1].etag != found.etag:
            self.models.append(
                RecordedModel(utc_ns, found.etag, found.adapted_from, found.reason)
            )

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
