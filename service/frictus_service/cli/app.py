"""The commands of `frictus`."""

from importlib.metadata import version
from pathlib import Path
from typing import Annotated

import typer

from frictus_service.cli import calibrate, experiment, models, pki, serve
from frictus_service.cli.checks import doctor, selftest
from frictus_service.cli.options import AsJson, CommandGroup, Workers
from frictus_service.cli.streams import bridges, play, record, replay, track
from frictus_service.cli.studies import discover, identify, study, study_import

app = typer.Typer(
    rich_markup_mode="markdown",
    name="frictus",
    cls=CommandGroup,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Feel textures on a friction-modulated touchscreen, over the network.",
    epilog=(
        "Exit codes: 0 done, 1 unexpected or a part did not start, 2 usage, 3 configuration, "
        "4 no router, rig or device, 5 refused by the rig, 6 a check failed, 130 interrupted."
    ),
)


def _say_version(asked: bool) -> None:
    if asked:
        typer.echo(f"frictus {version('frictus')}")
        raise typer.Exit


@app.callback()
def frictus(
    debug: Annotated[bool, typer.Option("--debug", help="Show tracebacks.")] = False,
    _version: Annotated[
        bool,
        typer.Option(
            "--version", help="Say which this is.", callback=_say_version, is_eager=True
        ),
    ] = False,
) -> None:
    """Feel textures on a friction-modulated touchscreen, over the network."""


BEGIN = "Begin here"
RIG = "Run a rig"
STREAMS = "Feel, watch and record"
PEOPLE = "Calibrate and ask people"
STUDIES = "Analyse studies"
CHECKS = "Check and measure"
KEPT = "Models and certificates"


@app.command(rich_help_panel=BEGIN)
def demo(
    as_json: AsJson = False,
    plot: Annotated[
        Path | None,
        typer.Option("--plot", metavar="FILE", help="Draw the spectra."),
    ] = None,
    seconds: Annotated[
        float | None,
        typer.Option("--seconds", min=1.0, help="How long.  [default: 10; 30 with --learn]"),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option("--seed", min=0, help="Of all that is drawn.  [default: a new one]"),
    ] = None,
    page: Annotated[
        bool, typer.Option("--page", help="Play it until Ctrl-C, and open the page on it.")
    ] = False,
    learn: Annotated[
        bool,
        typer.Option("--learn", help="Another finger than the model's, learned meanwhile."),
    ] = False,
) -> None:
    """Start a rig, stream a texture to it from another process, and show what is felt."""
    if learn:
        from frictus_service.cli.demo import demo_learn

        demo_learn(as_json, plot, seconds or 30.0, seed, page)
        return
    if page:
        from frictus_service.cli.demo_page import demo_page

        demo_page(seed)
        return
    from frictus_service.cli.demo import demo as run

    run(as_json=as_json, plot=plot, seconds=seconds or 10.0, seed=seed)


for panel, commands in {
    RIG: (serve.serve, serve.rig, serve.api, serve.router, serve.recorder, serve.tracker),
    STREAMS: (
        play.play,
        play.watch,
        track.track,
        record.record,
        record.verify,
        record.recover,
        replay.replay,
        bridges.lsl,
        bridges.foxglove,
    ),
    PEOPLE: (calibrate.calibrate, experiment.experiment),
    STUDIES: (
        study.export,
        identify.identify,
        discover.discover,
        discover.plan,
        identify.mount,
    ),
    CHECKS: (doctor.doctor, selftest.selftest, selftest.zero),
}.items():
    for command in commands:
        app.command(rich_help_panel=panel)(command)
study.study.command("import")(study_import.import_recordings)
app.add_typer(study.study, name="study", rich_help_panel=STUDIES)
app.add_typer(models.models, name="models", rich_help_panel=KEPT)
app.add_typer(pki.pki, name="pki", rich_help_panel=KEPT)


@app.command(rich_help_panel=CHECKS)
def bench(as_json: AsJson = False) -> None:
    """Measure kernel, wire and loop on this machine, each beside its bare counterpart."""
    from frictus_laboratory.benchmarks.report import bench as run

    run(as_json=as_json)


@app.command(rich_help_panel=STUDIES)
def paper(
    as_json: AsJson = False,
    participants: Annotated[
        int | None,
        typer.Option("--participants", min=2, help="How many.  [default: 8; 10 with --full]"),
    ] = None,
    full: Annotated[
        bool, typer.Option("--full", help="All of the paper's conditions: 10 GB.")
    ] = False,
    seconds: Annotated[
        float | None,
        typer.Option("--seconds", min=1.0, help="Of a trial.  [default: 3; 10 with --full]"),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Keep study, identification and table."),
    ] = None,
    seed: Annotated[int | None, typer.Option("--seed", min=0, help="[default: fresh]")] = None,
    workers: Workers = None,
) -> None:
    """Simulate the paper's study, analyse it blind, and set its values beside what came out."""
    from frictus_laboratory.reproduction.reproduce import run_paper as run

    run(participants, full, seconds, out, seed, workers, as_json)
