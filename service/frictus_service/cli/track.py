"""`frictus track`: what is known of the finger while any texture plays, or played."""

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from frictus_service.cli.options import (
    AsJson,
    ConfigFile,
    RigOption,
    RouterOption,
    Seconds,
    SiteOption,
    TargetRig,
    wants_lines,
    write_line,
)

if TYPE_CHECKING:
    from frictus.messages import EstimateState, Interval
    from frictus_hardware.physics.linear import TransferFunction
    from frictus_service.tracking.tracker import Tracker


def track(
    file: Annotated[
        Path | None,
        typer.Argument(metavar="[RECORDING]", help="A recording.  [default: a rig, live]"),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE", help="Write the model at the end.")
    ] = None,
    participant: Annotated[str | None, typer.Option("--participant", help="Pseudonym.")] = None,
    mount: Annotated[
        str, typer.Option("--mount", metavar="paper|none|FILE", help="Under the screen.")
    ] = "paper",
    rig: RigOption = None,
    site: SiteOption = None,
    router: RouterOption = None,
    config: ConfigFile = None,
    seconds: Seconds = None,
    as_json: AsJson = False,
) -> None:
    """Estimate the finger-screen model while any texture plays, and judge the one in force.

    The rig is not driven and its model is not changed.
    """
    from frictus_service.cli.study import mount_of

    under = mount_of(mount)
    if file is None:
        tracker, peak_v, source = _live(
            TargetRig.of(config, router, site, rig), under, seconds, as_json
        )
    else:
        tracker, peak_v, source = _recorded(file, under, as_json)
    state = tracker.state(time.time_ns())
    if not wants_lines(as_json):
        sys.stdout.write("".join(f"{line}\n" for line in summary_of(state)))
    if out is not None:
        model = tracker.model(participant, peak_v, {"rig": source})
        out.write_bytes(model.to_json())
        if wants_lines(as_json):
            write_line(event="model", file=str(out))
        else:
            sys.stdout.write(f"model: {out}\n")


def _live(
    target: TargetRig, mount: "TransferFunction | None", seconds: float | None, as_json: bool
) -> "tuple[Tracker, float, str]":
    import frictus
    from frictus.keys import Topics
    from frictus.session import declare_latest_publisher
    from frictus_service.calibration.coordinates import Prior
    from frictus_service.cli.record import interruption
    from frictus_service.security.members import tls_of_rig
    from frictus_service.tracking.sources import follow_rig, tracker_of

    with (
        frictus.connect(target.router, name="tracker", tls=tls_of_rig(target.config)) as client,
        interruption() as interrupted,
    ):
        found = target.choose(client)
        status = found.status()
        tracker = tracker_of(status, mount, Prior.weak())
        key = found.keys.of(Topics.ESTIMATE)
        publisher = declare_latest_publisher(client.session, key, Topics.ESTIMATE)

        def tell(state: "EstimateState") -> None:
            publisher.put(state.to_json())
            _show(state, as_json)

        begun_s = time.monotonic()

        def over() -> bool:
            late = seconds is not None and time.monotonic() - begun_s >= seconds
            return late or bool(interrupted)

        follow_rig(found, tracker, tell, over)
        publisher.undeclare()  # type: ignore[no-untyped-call]
        return tracker, status.screen_peak_v, status.rig


def _recorded(
    file: Path, mount: "TransferFunction | None", as_json: bool
) -> "tuple[Tracker, float, str]":
    from frictus_service.calibration.coordinates import Prior
    from frictus_service.recording.reader import RecordingReader
    from frictus_service.tracking.sources import follow_recording

    with RecordingReader(file) as reader:
        tracker, status = follow_recording(
            reader, mount, Prior.weak(), lambda state: _show(state, as_json)
        )
        if not reader.ending.complete:
            sys.stderr.write(f"the recording {reader.ending}\n")
    return tracker, status.screen_peak_v, status.rig


def _show(state: "EstimateState", as_json: bool) -> None:
    if wants_lines(as_json):
        write_line(event="estimate", **state.model_dump(mode="json"))
    elif sys.stderr.isatty():
        sys.stderr.write(f"\r\x1b[K{line_of(state)}")
        sys.stderr.flush()


def line_of(state: "EstimateState") -> str:
    """Return an estimate in one line.

    Parameters
    ----------
    state : EstimateState
        As it is published.
    """
    if state.law is None:
        return "nothing felt yet"
    errors = ", ".join(f"{name} {value:.2f} dB" for name, value in state.error_db.items())
    alarms = f"; wrong: {', '.join(state.alarms)}" if state.alarms else ""
    return (
        f"{state.windows} windows: gain {_with_share(state.law.gain_n, 'N')}, cutoff "
        f"{_with_share(state.law.cutoff_20_hz, 'Hz')} at 20, "
        f"{_with_share(state.law.cutoff_100_hz, 'Hz')} at 100 mm/s; {errors}{alarms}"
    )


def summary_of(state: "EstimateState") -> list[str]:
    """Return what is said at the end.

    Parameters
    ----------
    state : EstimateState
        As it is published.
    """
    refused = [f"left out, {reason}: {count}" for reason, count in state.refused.items()]
    if state.law is None:
        return [
            "nothing was felt: play a texture, and slide over it at 10 to 150 mm/s",
            *refused,
        ]
    law, errors = state.law, state.error_db
    lines = [
        f"gain        {_interval(law.gain_n, 3)} N",
        f"cutoff      {_interval(law.cutoff_20_hz, 0)} Hz at 20 mm/s",
        f"            {_interval(law.cutoff_100_hz, 0)} Hz at 100 mm/s",
        f"delay       {_interval(law.delay_us, 1)} us, of the rig's channels",
        f"from {state.windows} windows of 0.1 s, half overlapping",
    ]
    if "in_force" in errors and "newest" in errors:
        lines.append(
            f"a rendering by the model in force is {errors['in_force']:.2f} dB rms off, by "
            f"this one {errors['newest']:.2f} dB (predicted before it was used, last 10 s)"
        )
    if state.alarms:
        lines.append(
            f"the model in force is wrong: {', '.join(state.alarms)}; calibrate this person, "
            "or write this model with --out"
        )
    if state.new_fingers:
        lines.append(f"the finger became another without notice {state.new_fingers} times")
    return lines + refused


def _with_share(value: "Interval", unit: str) -> str:
    share = 50.0 * (value.high - value.low) / value.value
    return f"{value.value:.3g} {unit} ±{share:.1f} %"


def _interval(value: "Interval", digits: int) -> str:
    low, high = f"{value.low:.{digits}f}", f"{value.high:.{digits}f}"
    return f"{value.value:.{digits}f} [{low}, {high}]"
