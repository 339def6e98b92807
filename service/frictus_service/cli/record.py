"""`frictus record`: record a rig here, or have its recorder do it."""

import contextlib
import signal
import sys
import time
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from frictus_service.cli.lines import write_line
from frictus_service.cli.options import (
    AsJson,
    ConfigFile,
    RigOption,
    RouterOption,
    Seconds,
    SiteOption,
    TargetRig,
    wants_lines,
)

if TYPE_CHECKING:
    import frictus
    from frictus.messages import RecordingState, RecordRequest

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
    from frictus_service.recording.errors import NotWrittenError
    from frictus_service.recording.recording import BEAT_S, RecordingSession

    shown_s = 0.0
    with (
        _interruption() as interrupted,
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


@contextlib.contextmanager
def _interruption() -> Iterator[list[int]]:
    """Give a list that Ctrl-C fills, instead of ending what goes on."""
    interrupted: list[int] = []
    former = signal.signal(signal.SIGINT, lambda number, _frame: interrupted.append(number))
    try:
        yield interrupted
    finally:
        signal.signal(signal.SIGINT, former)


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
