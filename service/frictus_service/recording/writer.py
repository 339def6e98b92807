"""Writes one recording: MCAP, append-only, in chunks with checksums, synced to the disk.

A message reaches the operating system within 0.3 s and the disk within 1 s; a crash of this
process or of the machine costs no more. What was written is never touched again.
"""

import contextlib
import json
import os
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO, Final

from mcap.writer import CompressionType, IndexType, Writer

from frictus.block import Block
from frictus.closing import Closing
from frictus.files import sync_folder
from frictus.keys import STREAMS, Topic, Topics
from frictus.messages import MESSAGES
from frictus_service.durable import (
    put_in_free_place,
    remove_left_beside,
    unfinished_beside,
)
from frictus_service.errors import NotWrittenError
from frictus_service.recording.plain_schema import plain_schema
from frictus_service.recording.records import (
    END,
    GAPS,
    NOTES,
    PRESENCE,
    PROFILE,
    STREAM_NAMES,
    EndNote,
    GapNote,
    PresenceNote,
    RecordingInfo,
    StreamTotal,
)
from frictus_service.recording.samples import Coalescer, Samples

FLUSH_S: Final = 0.15
"""A chunk is closed and handed to the operating system this often."""
SYNC_S: Final = 0.5
"""The disk is told to keep it this often: once a second, with room for a slow disk."""
CHUNK_BYTES: Final = 8_000_000
SAMPLES_SCHEMA: Final = "frictus.samples/1"
JSON_SCHEMA: Final = "jsonschema"
STATES: Final = (
    Topics.FINGER,
    Topics.TOUCH,
    Topics.GUIDANCE,
    Topics.STATUS,
    Topics.SCENE,
    Topics.MODEL,
    Topics.TIME,
    Topics.ESTIMATE,
    Topics.MARKER,
)
"""Topics whose messages are recorded as they came."""


class RecordingWriter(Closing):
    """One recording under way; a context manager that leaves the file closed but not ended.

    Parameters
    ----------
    path : Path
        Must not exist; folders above it are made.
    info : RecordingInfo
        Rig, name, participant and software.
    attachments : mapping of name to bytes
        JSON documents, at the beginning of the file.
    monotonic_s : callable
        Clock for the cadence.

    Raises
    ------
    NotWrittenError
        If the name is taken or the file cannot be made. Also raised by every other method
        when the disk refuses.
    """

    def __init__(
        self,
        path: Path,
        info: RecordingInfo,
        attachments: Mapping[str, bytes],
        monotonic_s: Callable[[], float],
    ) -> None:
        self.path = path
        self.info = info
        self.totals = {name: StreamTotal() for name in STREAM_NAMES.values()}
        self._monotonic_s = monotonic_s
        self._coalescers = {stream: Coalescer() for stream in STREAMS}
        self._sequences: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._flushed_s = self._synced_s = monotonic_s()
        self._size = self._handed_over = 0
        self._file = create(path)
        self._writer: Any = Writer(
            self._file,
            CHUNK_BYTES,
            CompressionType.NONE,
            IndexType.ALL,
            enable_data_crcs=True,
        )
        try:
            with self._explained():
                self._begin(attachments)
        except NotWrittenError:
            self.close()
            path.unlink(missing_ok=True)  # nothing is in it yet that could be missed
            raise

    @property
    def bytes_written(self) -> int:
        """Size of the file so far."""
        return self._size if self._file.closed else self._file.tell()

    @property
    def in_place(self) -> bool:
        """Whether the file still bears its name, and holds what was handed over."""
        try:
            named, open_one = self.path.stat(), os.fstat(self._file.fileno())
        except OSError:
            return False
        return os.path.samestat(named, open_one) and open_one.st_size >= self._handed_over

    def block(self, block: Block) -> None:
        """Write a block; it may wait up to 0.1 s for company."""
        with self._explained():
            self._write(self._coalescers[block.stream].add(block))

    def gap(self, note: GapNote) -> None:
        """Write down that something is missing, before what follows it."""
        with self._explained():
            for number, name in STREAM_NAMES.items():
                if name == note.stream:
                    self._add_total(name, lost_blocks=note.missing_blocks)
                    self._write(self._coalescers[number].flush())
            self._message(GAPS, note.to_json(), note.utc_ns)

    def state(self, topic: Topic, payload: bytes, utc_ns: int) -> None:
        """Write a message of `STATES` as it came.

        Parameters
        ----------
        topic : Topic
            Its row in the table of keys.
        payload : bytes
            JSON.
        utc_ns : int
            What it holds for, or when it came.
        """
        with self._explained():
            self._message(topic.suffix, payload, utc_ns)

    def presence(self, present: bool, utc_ns: int) -> None:
        """Write down that the rig appeared or vanished."""
        note = PresenceNote(utc_ns=utc_ns, present=present)
        with self._explained():
            self._message(PRESENCE, note.to_json(), utc_ns)

    def tick(self) -> bool:
        """Hand over and sync what is due; return whether it was synced to the disk."""
        now_s = self._monotonic_s()
        if now_s - self._synced_s >= SYNC_S:
            self.sync()
            return True
        if now_s - self._flushed_s >= FLUSH_S:
            with self._explained():
                self._hand_over()
            self._flushed_s = now_s
        return False

    def sync(self) -> None:
        """Have the disk keep everything that was written so far."""
        with self._explained():
            self._hand_over()
            os.fsync(self._file.fileno())
        self._flushed_s = self._synced_s = self._monotonic_s()

    def _hand_over(self) -> None:
        self._writer.flush()
        self._handed_over = self._file.tell()

    def end(self, reason: str, utc_ns: int, seconds: float | None = None) -> None:
        """Finish the file: the last messages, the index, and a sync.

        Parameters
        ----------
        reason : str
            Why it ends.
        utc_ns : int
            Now.
        seconds : float or None
            How long it was recorded, by a clock that nobody sets.
        """
        with self._explained():
            for coalescer in self._coalescers.values():
                self._write(coalescer.flush())
            note = EndNote(utc_ns=utc_ns, reason=reason, streams=self.totals, seconds=seconds)
            self._message(END, note.to_json(), utc_ns)
            self._writer.finish()
            self._file.flush()
            os.fsync(self._file.fileno())
        self.close()

    def close(self) -> None:
        """Close the file as it stands. Closing twice, or after `end`, is harmless."""
        self._size = self.bytes_written
        with contextlib.suppress(OSError):  # what could not be written is reported already
            self._file.close()

    def _begin(self, attachments: Mapping[str, bytes]) -> None:
        self._writer.start(PROFILE, self.info.software)
        now_ns = self.info.started_utc_ns
        named = {"recording.json": self.info.to_json(), **attachments}
        for name, content in named.items():
            self._writer.add_attachment(now_ns, now_ns, name, "application/json", content)
        self._declare()
        # The first chunk carries the channels: on the disk before anything else is.
        self.presence(True, now_ns)
        self.sync()
        sync_folder(self.path.parent)

    def _declare(self) -> None:
        samples = self._writer.register_schema(SAMPLES_SCHEMA, "", b"")
        for number, topic in STREAMS.items():
            name = STREAM_NAMES[number]
            told = {"unit": topic.unit, "channels": topic.message.removeprefix("Block: ")}
            step = self.info.converter_steps.get(name)
            told |= {} if step is None else {"scale": repr(step)}
            self._channels[topic.suffix] = self._writer.register_channel(
                topic.suffix, SAMPLES_SCHEMA, samples, told
            )
        models = {topic.suffix: MESSAGES[topic.message] for topic in STATES} | NOTES
        for suffix, model in models.items():
            text = json.dumps(plain_schema(model)).encode()
            schema = self._writer.register_schema(model.__name__, JSON_SCHEMA, text)
            self._channels[suffix] = self._writer.register_channel(suffix, "json", schema)

    def _write(self, finished: list[Samples]) -> None:
        for samples in finished:
            name = STREAM_NAMES[samples.stream]
            payload = samples.pack(self.info.converter_steps.get(name))
            self._message(STREAMS[samples.stream].suffix, payload, samples.utc_ns)
            self._add_total(name, blocks=samples.blocks, samples=samples.data.shape[1])

    def _add_total(self, name: str, **counts: int) -> None:
        total = self.totals[name]
        update = {key: getattr(total, key) + count for key, count in counts.items()}
        self.totals[name] = total.model_copy(update=update)

    def _message(self, suffix: str, payload: bytes, utc_ns: int) -> None:
        sequence = self._sequences.get(suffix, 0)
        self._sequences[suffix] = sequence + 1
        at_ns = max(utc_ns, 0)  # MCAP knows no time before 1970
        self._writer.add_message(self._channels[suffix], at_ns, payload, at_ns, sequence)

    @contextlib.contextmanager
    def _explained(self) -> Iterator[None]:
        try:
            yield
        except NotWrittenError:  # explained already
            raise
        except OSError as error:
            raise NotWrittenError(
                f"{self.path} cannot be written any further ({error.strerror or error}); what "
                "was synced before is kept. Free the disk, and start another recording"
            ) from error


def create(path: Path) -> BinaryIO:
    """Return a new file; the folders above it are made.

    Raises
    ------
    NotWrittenError
        If the name is taken, or the file cannot be made.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _not_made(path.parent, error) from error
    try:
        return path.open("xb", buffering=1 << 20)
    except FileExistsError as error:
        raise _taken(path) from error
    except OSError as error:
        raise _not_made(path, error) from error


@contextlib.contextmanager
def new_file(path: Path) -> Iterator[BinaryIO]:
    """Give a file to write to, which bears its name once the context ends without an error.

    Parameters
    ----------
    path : Path
        What it is to be called; the folders above it are made.

    Raises
    ------
    NotWrittenError
        If the name is taken, or the disk refuses.
    """
    if path.exists():
        raise _taken(path)
    unfinished = unfinished_beside(path)
    try:
        with create(unfinished) as file:
            remove_left_beside(path)
            yield file
        put_in_free_place(unfinished, path)
    except FileExistsError as error:
        raise _taken(path) from error
    except NotWrittenError:  # explained already
        raise
    except OSError as error:
        raise NotWrittenError(f"{path} cannot be written: {error.strerror or error}") from error
    finally:
        unfinished.unlink(missing_ok=True)


def _taken(path: Path) -> NotWrittenError:
    return NotWrittenError(f"there is a recording {path} already; give this one another name")


def _not_made(path: Path, error: OSError) -> NotWrittenError:
    return NotWrittenError(
        f"{path} cannot be made ({error.strerror or error}): choose a folder that this user "
        "may write to"
    )
