"""`frictus track`: what is known of the finger while any texture plays, or played."""

import math
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from frictus_service.cli.options import (
    AsJson,
    ConfigFile,
    RigOption,
    RouterOption,
    Seconds,
    SiteOption,
    TargetRig,
    check_out,
    wants_lines,
    write_line,
    write_out,
)

if TYPE_CHECKING:
    from frictus import Client
    from frictus.messages import EstimateState, Interval
    from frictus.model import Model
    from frictus.rig import Rig
    from frictus_service.config import Config

SILENT_S: Final = 3.0
Z95: Final = 1.96
"""Standard errors that half an interval of 95 % has."""
STUDIES: Final = (".h5", ".hdf5")
MOUNT: Final = "paper"
OF_TONES: Final = (
    "trials of single tones: `frictus identify` fits all of them at once, and knows their "
    "cutoffs and delay better"
)


def track(
    file: Annotated[
        Path | None,
        typer.Argument(metavar="[FILE]", help="A recording or study.  [default: a rig, live]"),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE", help="Write the model at the end.")
    ] = None,
    participant: Annotated[str | None, typer.Option("--participant", help="Pseudonym.")] = None,
    mount: Annotated[
        str | None,
        typer.Option(
            "--mount", metavar="paper|none|FILE", help="Under the screen.  [default: paper]"
        ),
    ] = None,
    rig: RigOption = None,
    site: SiteOption = None,
    router: RouterOption = None,
    config: ConfigFile = None,
    seconds: Seconds = None,
    as_json: AsJson = False,
) -> None:
    """Estimate the finger-screen model while any texture plays, and judge the one in force.

    The rig is not driven. Where its service tracks already, what that knows is shown; elsewhere
    this command tracks until it ends, and its model follows under the policy `adapt`.
    """
    check_out(out, *(Path(each) for each in (file, mount) if each is not None))
    if file is None:
        target = TargetRig.of(config, router, site, rig)
        state = _live(target, mount, seconds, as_json)
    elif file.suffix.lower() in STUDIES:
        if mount is not None:
            raise typer.BadParameter(f"--mount {mount}: {file} says which mount it has")
        state = _studied(file, participant, as_json)
    else:
        state = _recorded(file, mount or MOUNT, as_json)
    if state is not None and not wants_lines(as_json):
        if sys.stderr.isatty():
            sys.stderr.write("\n")  # behind the line that was written over
        sys.stdout.write("".join(f"{line}\n" for line in summary_of(state, file is None)))
    if out is not None:
        model = document_of(state, participant)
        write_out(out, model.to_json())
        if wants_lines(as_json):
            write_line(event="model", file=str(out))
        else:
            sys.stdout.write(f"model: {out}\n")


def _live(
    target: TargetRig, mount: str | None, seconds: float | None, as_json: bool
) -> "EstimateState | None":
    import frictus
    from frictus.errors import LinkError
    from frictus.keys import Topics
    from frictus_service.processes import interruption
    from frictus_service.security.members import tls_of_rig

    told: list[EstimateState] = []

    def tell(state: "EstimateState") -> None:
        told[:] = [state]
        _show(state, as_json)

    with (
        frictus.connect(target.router, name="tracker", tls=tls_of_rig(target.config)) as client,
        interruption() as interrupted,
    ):
        rig = target.choose(client)
        begun_s: list[float] = []

        def over() -> bool:
            if not begun_s:  # what is loaded first takes seconds that are not the finger's
                begun_s.append(time.monotonic())
            late = seconds is not None and time.monotonic() - begun_s[0] >= seconds
            return late or bool(interrupted)

        try:
            rig.estimate()
        except LinkError:  # nobody tracks this rig
            _track(client, rig, mount or MOUNT, target.config, tell, over)
        else:
            if mount is not None:
                raise typer.BadParameter(
                    f"--mount {mount}: this rig has a tracker, whose [tracker] of the "
                    "configuration says the mount; leave it out"
                )
            with rig.watch(Topics.ESTIMATE, timeout_s=SILENT_S) as states:
                for state in states:
                    tell(state)  # type: ignore[arg-type]
                    if over():
                        break
    return told[0] if told else None


def _track(
    client: "Client",
    rig: "Rig",
    mount: str,
    config: "Config",
    tell: "Callable[[EstimateState], None]",
    over: "Callable[[], bool]",
) -> None:
    """Be the tracker of a rig."""
    from frictus.keys import Topics
    from frictus.session import declare_latest_publisher
    from frictus_service.study.trial import read_mount
    from frictus_service.tracking.audit import ModelChangeLog
    from frictus_service.tracking.live import LiveTracker
    from frictus_service.tracking.process import population_of

    publisher = declare_latest_publisher(
        client.session, rig.keys.of(Topics.ESTIMATE), Topics.ESTIMATE
    )

    def publish(state: "EstimateState") -> None:
        publisher.put(state.to_json())
        tell(state)

    def say(line: str) -> None:
        sys.stderr.write(f"{line}\n")

    population = population_of(config, rig.status().simulated, say)
    audit = ModelChangeLog(config.tracker.audit)
    with LiveTracker(rig, read_mount(mount), population, publish, audit) as live:
        live.follow(over)
    publisher.undeclare()  # type: ignore[no-untyped-call]


def _recorded(file: Path, mount: str, as_json: bool) -> "EstimateState":
    from frictus_service.calibration.coordinates import Prior
    from frictus_service.recording.reader import RecordingReader
    from frictus_service.study.trial import read_mount
    from frictus_service.tracking.recorded import follow_recording

    with RecordingReader(file) as reader:
        state = follow_recording(
            reader, read_mount(mount), Prior.weak(), lambda told: _show(told, as_json)
        )
        if not reader.ending.complete:
            sys.stderr.write(f"the recording {reader.ending}\n")
    return state


def _studied(file: Path, participant: str | None, as_json: bool) -> "EstimateState":
    """Follow a participant of a study, and return the estimate."""
    from frictus_service.calibration.coordinates import Prior
    from frictus_service.errors import EstimateError
    from frictus_service.identification.pipeline.study import OBSERVER, read_study, records_of
    from frictus_service.identification.plausibility.finding import stop_if_implausible
    from frictus_service.identification.plausibility.judge import judge_study
    from frictus_service.identification.plausibility.position_delay import delay_text
    from frictus_service.study.file_state import unchanged
    from frictus_service.study.reader import StudyReader
    from frictus_service.tracking.recorded import follow_study

    with unchanged(file), StudyReader(file) as reader:
        if any(len(asked.tones_hz) == 1 for asked in reader.trials):
            sys.stderr.write(f"{OF_TONES}\n")
        known = list(dict.fromkeys(each.participant for each in reader.trials))
        if known and participant not in known and (participant or len(known) > 1):
            named = f"{participant!r} is none of them" if participant else "name one"
            raise EstimateError(
                f"{file} has the participants {', '.join(known)}: {named} with --participant"
            )
        records = records_of(read_study(file, OBSERVER))
        stop_if_implausible(judge_study(records, "friction"), str(file))
        late_s = max((each.statistics.positions_earlier_s for each in records), default=0.0)
        if late_s:
            sys.stderr.write(f"positions come {delay_text(late_s)}: read without it\n")
        states = follow_study(
            reader, Prior.weak(), lambda told: _show(told, as_json), late_s, participant
        )
        for left_out in reader.excluded:
            sys.stderr.write(f"trial {left_out.trial} is left out: {left_out.reason}\n")
    if not states:
        raise EstimateError(f"{file} has no trial that can be followed; see what is left out")
    return next(iter(states.values()))


def document_of(state: "EstimateState | None", participant: str | None) -> "Model":
    """Return the estimate as a document of a participant.

    Parameters
    ----------
    state : EstimateState or None
        The last that was told.
    participant : str or None
        Pseudonym; None: whom the tracker took the finger for.

    Raises
    ------
    EstimateError
        If nothing was felt.
    """
    from frictus_service.errors import EstimateError

    if state is None or state.model is None:
        refused = {} if state is None else state.refused
        left_out = ", ".join(f"{why}: {n}" for why, n in refused.items())
        raise EstimateError(
            "no window could be used, so nothing is known of the finger; left out: "
            f"{left_out or 'nothing came'}. Play a texture, and slide over it"
        )
    return state.model.model_copy(
        update={"participant": participant or state.model.participant}
    )


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
    whose = f"{state.participant}, " if state.participant else ""
    return (
        f"{whose}{state.windows} windows: gain {_with_share(state.law.gain_n, 'N')}, cutoff "
        f"{_with_share(state.law.cutoff_20_hz, 'Hz')} at 20, "
        f"{_with_share(state.law.cutoff_100_hz, 'Hz')} at 100 mm/s; {errors}{alarms}"
    )


def _outlook_of(state: "EstimateState") -> str:
    """Return what became of the model in force, or would."""
    from frictus.messages import MAX_CHANGES

    if (changes := len(state.changes)) == MAX_CHANGES:
        return f"the model was changed {changes} times or more while it played"
    if changes:
        return f"the model was changed {changes} times while it played"
    if state.held_back:
        return f"the model in force stays: {state.held_back}"
    return "under the policy `adapt` this would replace the model in force"


def summary_of(state: "EstimateState", live: bool) -> list[str]:
    """Return what is said at the end.

    Parameters
    ----------
    state : EstimateState
        As it is published.
    live : bool
        Whether it is of a rig, whose model might follow.
    """
    refused = [f"left out, {reason}: {count}" for reason, count in state.refused.items()]
    if state.law is None:
        return [
            "nothing was felt: play a texture, and slide over it at 10 to 150 mm/s",
            *refused,
        ]
    law, errors = state.law, state.error_db
    lines = [
        f"gain        {_interval(law.gain_n, 3)} N in the newest contact",
        *_gain_of_person(state.model),
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
    for cause in state.alarms:
        lines.append(f"wrong: {cause}: {state.advice.get(cause, '')}")
    if live:
        lines.append(_outlook_of(state))
    if state.new_fingers:
        whose = "; --participant says whose it is now" if live and state.participant else ""
        lines.append(
            f"the finger became another without notice {state.new_fingers} times{whose}"
        )
    return lines + refused


def _gain_of_person(model: "Model | None") -> list[str]:
    """Return the line of the gain about which a person's contacts lie, which is published."""
    from frictus.model import FirstOrderSpeedLaw

    if model is None or model.covariance is None:
        return []
    if not isinstance(model.base, FirstOrderSpeedLaw):
        return []
    gain_n = model.base.gain_n
    at = model.covariance.parameters.index("gain_n")
    half = Z95 * math.sqrt(model.covariance.matrix[at][at]) / gain_n
    low, high = gain_n * math.exp(-half), gain_n * math.exp(half)
    return [f"            {gain_n:.3f} [{low:.3f}, {high:.3f}] N in the mean of contacts"]


def _with_share(value: "Interval", unit: str) -> str:
    share = 50.0 * (value.high - value.low) / value.value
    return f"{value.value:.3g} {unit} ±{share:.1f} %"


def _interval(value: "Interval", digits: int) -> str:
    low, high = f"{value.low:.{digits}f}", f"{value.high:.{digits}f}"
    return f"{value.value:.{digits}f} [{low}, {high}]"
