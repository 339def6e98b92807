"""`frictus experiment`: a psychophysical experiment at the terminal, or with an observer."""

import sys
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from frictus_service.cli.options import (
    AsJson,
    ConfigFile,
    RandomSeed,
    RigOption,
    RouterOption,
    SiteOption,
    TargetRig,
    wants_lines,
    write_line,
)

OBSERVER: Final = "observer"
"""How the pseudonyms of simulated observers begin."""

if TYPE_CHECKING:
    from frictus.experiment import (
        Experiment,
        Participant,
        PresentedInterval,
        Protocol,
        ScheduledTrial,
    )


def experiment(
    protocol: Annotated[
        str,
        typer.Argument(
            metavar="PROTOCOL",
            help="TOML file, or detection, amplitude-difference or similarity.",
        ),
    ],
    participant: Annotated[
        str | None,
        typer.Option(
            "--participant",
            metavar="P",
            help="Pseudonym: letters and digits.  [default: 01; observer, of a simulated one]",
        ),
    ] = None,
    order_row: Annotated[
        int,
        typer.Option("--order", min=0, help="Row of the Latin square: number of the person."),
    ] = 0,
    log: Annotated[
        Path | None,
        typer.Option(
            "--log",
            metavar="FILE",
            help="Trials; one that is there is gone on with.  [default: PROTOCOL-P.jsonl]",
        ),
    ] = None,
    events: Annotated[
        Path | None,
        typer.Option("--events", metavar="DIR", help="Also write a BIDS table of the trials."),
    ] = None,
    observer: Annotated[
        bool,
        typer.Option(
            "--observer",
            help="A simulated observer answers, on a simulated rig; its name begins so.",
        ),
    ] = False,
    results_only: Annotated[
        bool, typer.Option("--results", help="Present nothing; say what the log says.")
    ] = False,
    seed: RandomSeed = None,
    rig: RigOption = None,
    site: SiteOption = None,
    router: RouterOption = None,
    config: ConfigFile = None,
    as_json: AsJson = False,
) -> None:
    """Run the experiment of PROTOCOL; begun anew with the same log, it goes on."""
    import frictus
    from frictus.experiment import (
        Experiment,
        SimulatedObserver,
        VirtualParticipant,
        load_protocol,
        read_log,
        results,
        write_events,
    )
    from frictus.experiment.procedures.schedule import begun
    from frictus_service.experiments.report import result_lines

    chosen = load_protocol(protocol)
    named, participant = participant, participant or (OBSERVER if observer else "01")
    if observer != participant.startswith(OBSERVER):
        raise typer.BadParameter(
            f"participant {participant!r}: the name of a simulated observer (--observer) "
            f"begins with {OBSERVER!r}, and nobody else's does: they never share a log"
        )
    path = log or Path(f"{chosen.name}-{participant}.jsonl")
    if not results_only:
        target = TargetRig.of(config, router, site, rig)
        sys.stderr.write(f"log: {path}; Ctrl-C ends it, and the same command goes on\n")
        with frictus.connect(target.router, tls=target.tls) as client:
            found = target.choose(client)
            made = Experiment.of(
                found,
                chosen,
                log=path,
                participant=participant,
                order_row=order_row,
                seed=seed,
            )
            person: Participant
            if observer:
                virtual = VirtualParticipant(found, chosen.task, SimulatedObserver(), made.seed)
                with closing(virtual), made:
                    _say_place(made, participant)
                    made.run(_Told(virtual))
            else:
                person = Keyboard(chosen)
                with made:
                    _say_place(made, participant)
                    made.run(person)
    rows, _ = read_log(path)
    if rows:
        begun(chosen, rows[0], str(path))  # what another protocol asked is not analysed
        if named is not None and (held := rows[0].get("participant")) != named:
            raise typer.BadParameter(f"{path} is of participant {held!r}, not {named!r}")
    if events is not None:
        table, sidecar = write_events(rows, events)
        sys.stderr.write(f"events: {table}, {sidecar}\n")
    found_results = results(chosen, rows)
    if not found_results:
        sys.stderr.write(f"{path} holds no answered trials beyond practice yet\n")
    for each in found_results:
        if wants_lines(as_json):
            write_line(event="result", log=str(path), **each.fields())
        else:
            sys.stdout.write("\n".join(result_lines(each)) + "\n")


class _Told:
    """A participant whose trials are told, a line each: they take minutes."""

    def __init__(self, person: "Participant") -> None:
        self._person = person
        self.rest, self.begin, self.learn = person.rest, person.begin, person.learn

    def ask(self, trial: "ScheduledTrial", intervals: "list[PresentedInterval]") -> str:
        given = self._person.ask(trial, intervals)
        _say(f"trial {trial.number}: {given}")
        return given


class Keyboard:
    """A participant at the terminal.

    Parameters
    ----------
    protocol : Protocol
        The experiment.
    """

    def __init__(self, protocol: "Protocol") -> None:
        self._protocol = protocol
        self._question = protocol.task.question

    def rest(self, trial: "ScheduledTrial") -> None:
        """Wait for Enter.

        Parameters
        ----------
        trial : ScheduledTrial
            What comes next.
        """
        _discard_typed()
        _say("A break. Press Enter to go on.")
        _read()

    def begin(self, trial: "ScheduledTrial", interval: int) -> None:
        """Say which interval begins.

        Parameters
        ----------
        trial : ScheduledTrial
            Under way.
        interval : int
            From 1.
        """
        if interval == 1:
            practice = ", practice" if trial.phase == "practice" else ""
            _say(f"\ntrial {trial.number}{practice}: move your finger")
        _say(f"  interval {interval} ...")

    def ask(self, trial: "ScheduledTrial", intervals: "list[PresentedInterval]") -> str:
        """Ask, and read a line.

        Parameters
        ----------
        trial : ScheduledTrial
            Under way.
        intervals : list of PresentedInterval
            What was presented.
        """
        from frictus.experiment.tasks import checked

        _discard_typed()
        if not all(each.felt for each in intervals):
            _say("  (the finger did not touch the screen, or did not move: this comes again)")
        while True:
            _say(f"  {self._question} ")
            answer = _read()
            try:
                return checked(self._protocol.task, answer)
            except ValueError as error:
                _say(f"  {error}")

    def learn(self, trial: "ScheduledTrial", right: bool) -> None:
        """Say whether it was right.

        Parameters
        ----------
        trial : ScheduledTrial
            Answered.
        right : bool
            Whether it was.
        """
        _say("  right" if right else "  wrong")


def _say_place(experiment: "Experiment", participant: str) -> None:
    """Say that a log holds trials already: they may be another person's of the same name."""
    if before := experiment.schedule.recorded:
        goes_on = experiment.next() is not None
        rest = "goes on after them" if goes_on else "is complete: nothing is presented"
        _say(f"the log holds {before} trials of {participant!r} and {rest}")


def _say(text: str) -> None:
    """Write to the participant; standard output is for results."""
    sys.stderr.write(text + "\n")
    sys.stderr.flush()


def _discard_typed() -> None:
    """Discard what was typed at a terminal before the question: it answers no trial."""
    if not sys.stdin.isatty():
        return
    if sys.platform == "win32":
        import msvcrt

        while msvcrt.kbhit():
            msvcrt.getwch()
    else:
        import termios

        termios.tcflush(sys.stdin, termios.TCIFLUSH)


def _read() -> str:
    line = sys.stdin.readline()
    if not line:  # the end of input is no answer: the log waits for another day
        raise KeyboardInterrupt
    return line.strip()
