"""A finished file from a torn one: what can be trusted of it, written anew."""

import time
from pathlib import Path
from typing import Any, Final

from mcap.records import Channel, Schema
from mcap.writer import CompressionType, IndexType, Writer

from frictus_service.errors import RecordingError
from frictus_service.recording.reader import RecordingReader
from frictus_service.recording.records import END, PROFILE, EndNote, RecordScanner, StreamTotal
from frictus_service.recording.summary import RecordingSummary, summarise
from frictus_service.recording.writer import new_file

CHUNK_BYTES: Final = 1_000_000
_SETTINGS: Final = (CompressionType.NONE, IndexType.ALL)


def recover(path: Path, out: Path) -> RecordingSummary:
    """Write what can be read of a torn recording as one that ends in order, byte for byte.

    Parameters
    ----------
    path : Path
        Stays as it is.
    out : Path
        Must not exist.

    Returns
    -------
    RecordingSummary
        Of what was read; its ending says what is lost, and where.

    Raises
    ------
    RecordingError
        If the file is no recording, is complete, or torn before anything was recorded.
    NotWrittenError
        If `out` exists or cannot be written.
    """
    with RecordingReader(path) as reader:
        summary = summarise(reader)
    if summary.ending.complete:
        raise RecordingError(f"{path} is complete, there is nothing to recover")
    if not summary.presence:
        raise RecordingError(f"{path} holds nothing that can be read: {summary.ending.reason}")
    with new_file(out) as file:
        _copy(path, summary, Writer(file, CHUNK_BYTES, *_SETTINGS, enable_data_crcs=True))
    return summary


def _copy(path: Path, summary: RecordingSummary, writer: Any) -> None:
    """Copy the records of the clean beginning, then say why it ends."""
    writer.start(PROFILE, summary.info.software)
    ending = summary.ending
    ids: dict[str, int] = {}
    with path.open("rb") as file:
        for piece in RecordScanner(file, ending.total_bytes).pieces():
            if piece.end > ending.clean_bytes:
                break
            if piece.attachment is not None:
                found = piece.attachment
                writer.add_attachment(
                    found.create_time, found.log_time, found.name, found.media_type, found.data
                )
            for record in piece.inner:
                # Numbers are given in order, so that they stay what they were.
                if isinstance(record, Schema):
                    writer.register_schema(record.name, record.encoding, record.data)
                elif isinstance(record, Channel):
                    writer.register_channel(
                        record.topic,
                        record.message_encoding,
                        record.schema_id,
                        record.metadata,
                    )
                    ids[record.topic] = record.id
                else:
                    writer.add_message(
                        record.channel_id,
                        record.log_time,
                        record.data,
                        record.publish_time,
                        record.sequence,
                    )
            if piece.end == ending.clean_bytes:
                break
    if summary.end is None:
        note = _end_of(path, summary)
        writer.add_message(ids[END], note.utc_ns, note.to_json(), note.utc_ns, 0)
    writer.finish()


def _end_of(path: Path, summary: RecordingSummary) -> EndNote:
    return EndNote(
        utc_ns=time.time_ns(),
        reason=f"recovered from {path.name}, which {summary.ending}",
        streams={
            name: StreamTotal(
                blocks=one.blocks, samples=one.samples, lost_blocks=one.lost_blocks
            )
            for name, one in summary.streams.items()
        },
        seconds=summary.ending.clean_s,
    )
