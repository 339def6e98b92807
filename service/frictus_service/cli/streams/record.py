"""`frictus record`, `verify` and `recover`: recordings made, checked and repaired."""

import sys
import time
from collections.abc import Sized
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from frictus_service.cli.options import (
    AsJson,
    ConfigFile,
    Exit,
    RigOption,
    RouterOption,
    Seconds,
    SiteOption,
    TargetRig,
    check_out_folder,
    wants_lines,
    write_line,
)

if TYPE_CHECKING:
    import frictus
    from frictus.messages import RecordingState, RecordRequest
    from frictus_service.recording.summary import RecordingSummary

MOST_SHOWN = 20
SHOWN_S = 0.5


def record(
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="FILE", help="File.  [default: NAME.mcap in the folder configured]"
        ),
    ] = None,
    name: Annotated[
        str | None, typer.Option("--name", help="Of the recording.  [default: date and time]")
    ] = None,
    participant: Annotated[str | None, typer.Option("--participant", help="Pseudonym.")] = None,
    notes: Annotated[str, typer.Option("--notes", help="Kept in the recording.")] = "",
    start: Annotated[
        bool, typer.Option("--start", help="Have the rig's recorder start, and return.")
    ] = False,
    stop: Annotated[
        bool, typer.Option("--stop", help="Have the rig's recorder end, and return.")
    ] = False,
    rig: RigOption = None,
    site: SiteOption = None,
    router: RouterOption = None,
    config: ConfigFile = None,
    seconds: Seconds = None,
    as_json: AsJson = False,
) -> None:
    """Record all that a rig publishes in a file here, until Ctrl-C; or drive its recorder."""
    from pydantic import ValidationError

    import frictus
    from frictus.errors import ArgumentError, explain
    from frictus.messages import RecordRequest

    _check_together(start, stop, out, seconds)
    target = TargetRig.of(config, router, site, rig)
    given = name or (out.stem if out is not None else _name_of_now())
    with frictus.connect(target.router, tls=target.tls) as client:
        found = target.choose(client)
        if stop:
            _tell(found.end_recording(), as_json)
        elif start:
            _tell(found.record(given, participant, notes), as_json)
        else:
            try:
                request = RecordRequest(
                    client=client.name,
                    utc_ns=time.time_ns(),
                    name=given,
                    participant=participant,
                    notes=notes,
                )
            except ValidationError as error:
                raise ArgumentError(f"recording: {explain(error)}") from error
            path = out or target.config.recordings / f"{given}.mcap"
            _record_here(client, found, request, path, target, seconds, as_json)


def _check_together(start: bool, stop: bool, out: Path | None, seconds: float | None) -> None:
    if start and stop:
        raise typer.BadParameter("--start or --stop, not both")
    if (start or stop) and (out is not None or seconds is not None):
        raise typer.BadParameter(
            "the rig's recorder chooses the file, and records until --stop: "
            "--out and --seconds go without --start and --stop"
        )


def _name_of_now() -> str:
    return f"{datetime.now(UTC):%Y-%m-%dT%H%M%SZ}"


def _record_here(
    client: "frictus.Client",
    rig: "frictus.Rig",
    request: "RecordRequest",
    path: Path,
    target: TargetRig,
    seconds: float | None,
    as_json: bool,
) -> None:
    from frictus_service.errors import NotWrittenError
    from frictus_service.processes import interruption
    from frictus_service.recording.recording import BEAT_S, RecordingSession

    shown_s = 0.0
    with (
        interruption() as interrupted,
        RecordingSession(client, rig, request, path, target.config) as recording,
    ):
        begun_s = time.monotonic()
        _note(f"records {path}; Ctrl-C ends it")
        while not recording.ended and not interrupted:
            now_s = time.monotonic()
            if seconds is not None and now_s - begun_s >= seconds:
                break
            if not wants_lines(as_json) and now_s - shown_s >= SHOWN_S:
                _show(recording.state())
                shown_s = now_s
            time.sleep(BEAT_S)
            recording.beat()
    state = recording.state()
    _tell(state, as_json)
    if state.problem is not None:
        raise NotWrittenError(state.problem)


def _note(line: str) -> None:
    sys.stderr.write(f"{line}\n")
    sys.stderr.flush()


def _show(state: "RecordingState") -> None:
    sys.stderr.write(
        f"\r{state.seconds:8.1f} s  {state.bytes_written / 1e6:8.1f} MB  "
        f"{state.blocks} blocks, {state.lost_blocks} lost "
    )
    sys.stderr.flush()


def _tell(state: "RecordingState", as_json: bool) -> None:
    if wants_lines(as_json):
        write_line(**state.model_dump(mode="json"))
        return
    did = "records" if state.recording else "recorded"
    sys.stdout.write(
        f"{did} {state.path}: {state.seconds:.1f} s, {state.bytes_written / 1e6:.1f} MB, "
        f"{state.blocks} blocks, {state.lost_blocks} lost\n"
    )


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
    lines += _compensation_lines(summary) + _model_lines(summary)
    gaps = [
        f"gap in {gap.stream}: {gap.missing_blocks} from {gap.first_missing_sequence} of "
        f"run {gap.run}, {gap.missing_samples} samples, {gap.reason} {gap.detail}".rstrip()
        for gap in summary.gaps[:MOST_SHOWN]
    ]
    lines += gaps + _more(summary.gaps, "gaps")
    lines += [f"FAULT: {fault}" for fault in summary.faults]
    if summary.end is not None:
        lines.append(f"ended: {summary.end.reason}")
    return lines


def _model_lines(summary: "RecordingSummary") -> list[str]:
    """Return when which model was in force; nothing for one throughout."""
    models = summary.models
    if len(models) < 2:
        return []
    lines = [
        f"model {model.etag} from {1e-9 * (model.utc_ns - models[0].utc_ns):.2f} s"
        + (f", adapted: {' '.join(model.reason.split())}" if model.adapted_from else "")
        for model in models[:MOST_SHOWN]
    ]
    return lines + _more(models, "changes")


def _compensation_lines(summary: "RecordingSummary") -> list[str]:
    """Return when which compensation mode was in force; nothing for the model throughout."""
    changes = summary.compensations
    if all(change.compensation.mode == "model" for change in changes):
        return []
    lines = [
        f"compensation {change.compensation} from "
        f"{1e-9 * (change.utc_ns - changes[0].utc_ns):.2f} s"
        for change in changes[:MOST_SHOWN]
    ]
    return lines + _more(changes, "changes")


def _more(told: Sized, what: str) -> list[str]:
    more = len(told) - MOST_SHOWN
    return [f"and {more} {what} more; --json has them all"] if more > 0 else []


def recover(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Torn recording; is kept.")],
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="[default: FILE with .recovered.mcap]"),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Write all that can be trusted of FILE as a finished recording, and say what is lost."""
    from frictus_service.recording.recovery import recover as run

    path = out or file.with_suffix(".recovered.mcap")
    check_out_folder(path.parent, file)
    summary = run(file, path)
    if wants_lines(as_json):
        write_line(out=str(path), **summary.fields())
    else:
        sys.stdout.write(f"{path}: {summary.ending.clean_s:.2f} s\n{file} {summary.ending}\n")
