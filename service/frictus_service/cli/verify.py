"""`frictus verify`: whether a recording is sound."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from frictus_service.cli.exits import Exit
from frictus_service.cli.lines import write_line
from frictus_service.cli.options import AsJson, wants_lines

if TYPE_CHECKING:
    from frictus_service.recording.summary import RecordingSummary

SHOWN_GAPS = 20


def verify(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Recording.")],
    as_json: AsJson = False,
) -> None:
    """Read FILE whole: checksums, counts, gaps, duration. Exit code 6 if it is not sound."""
    from frictus_service.recording.reader import RecordingReader
    from frictus_service.recording.summary import summarise

    with RecordingReader(file) as reader:
        summary = summarise(reader)
    if wants_lines(as_json):
        write_line(file=str(file), **summary.fields())
    else:
        sys.stdout.write("".join(f"{line}\n" for line in lines_of(file, summary)))
    if not summary.sound:
        raise typer.Exit(Exit.CHECK_FAILED)


def lines_of(file: Path, summary: "RecordingSummary") -> list[str]:
    """Return what to tell of a recording."""
    info = summary.info
    who = f", participant {info.participant}" if info.participant else ""
    lines = [f"{file}: {summary.ending}", f"{info.rig} at {info.site}{who}, {info.software}"]
    for name, one in summary.streams.items():
        lost = f"; {one.gaps} gaps, {one.lost_blocks} blocks lost" if one.gaps else "; no gap"
        lines.append(f"{name}: {one.blocks} blocks, {one.seconds:.2f} s{lost}")
    lines += [f"{topic}: {count} messages" for topic, count in summary.states.items()]
    for gap in summary.gaps[:SHOWN_GAPS]:
        lines.append(
            f"gap in {gap.stream}: {gap.missing_blocks} from {gap.first_missing_sequence} of "
            f"run {gap.run}, {gap.missing_samples} samples, {gap.reason} {gap.detail}".rstrip()
        )
    if len(summary.gaps) > SHOWN_GAPS:
        lines.append(f"and {len(summary.gaps) - SHOWN_GAPS} gaps more; --json has them all")
    lines += [f"FAULT: {fault}" for fault in summary.faults]
    if summary.end is not None:
        lines.append(f"ended: {summary.end.reason}")
    return lines
