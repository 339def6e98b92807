"""`frictus calibrate`: measure a participant on a rig, and say what model comes of it."""

import secrets
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from frictus_service.cli.options import (
    AsJson,
    ConfigFile,
    RigOption,
    RouterOption,
    SiteOption,
    TargetRig,
    wants_lines,
    whoever_asks,
    write_line,
)

if TYPE_CHECKING:
    from frictus.model import Model
    from frictus_service.calibration.job import (
        CalibrationResult,
        CalibrationSpec,
        PaperProtocol,
        QuickProtocol,
    )

ProtocolName = Literal["quick", "paper"]


def calibrate(
    participant: Annotated[
        str, typer.Option("--participant", metavar="P", help="Pseudonym, such as P01.")
    ],
    protocol: Annotated[
        ProtocolName | None,
        typer.Option(
            "--protocol",
            help="A minute with a prior, or 375 trials in sessions.  [default: quick]",
        ),
    ] = None,
    purpose: Annotated[
        Literal["discovery"] | None,
        typer.Option(
            "--for", help="In place of a protocol: 72 trials, 5 minutes, to discover in."
        ),
    ] = None,
    precision: Annotated[
        float | None,
        typer.Option(
            "--precision",
            min=0.001,
            max=1.0,
            help="Quick: half of the cutoff's 95 % interval over its value.  [default: 0.05]",
        ),
    ] = None,
    no_prior: Annotated[
        bool, typer.Option("--no-prior", help="Quick: learn nothing from earlier people.")
    ] = False,
    session: Annotated[
        int, typer.Option("--session", min=0, help="Paper: number of this session.")
    ] = 1,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="DIR",
            help="A folder that holds one goes on with it.  [default: STUDIES/RIG-P-PROTOCOL]",
        ),
    ] = None,
    seed: Annotated[
        int | None, typer.Option("--seed", min=0, help="Of order and phases.  [default: fresh]")
    ] = None,
    publish: Annotated[
        bool, typer.Option("--publish", help="Publish the model in the registry.")
    ] = False,
    rig: RigOption = None,
    site: SiteOption = None,
    router: RouterOption = None,
    config: ConfigFile = None,
    as_json: AsJson = False,
) -> None:
    """Guide a participant through a calibration; Ctrl-C keeps what is finished.

    The same command goes on where it ended.
    """
    import frictus
    from frictus_service.calibration.run import run_calibration
    from frictus_service.cli.guided import Watching
    from frictus_service.durable import replace_file

    target = TargetRig.of(config, router, site, rig)
    lines = wants_lines(as_json)
    with frictus.connect(target.router, tls=target.tls) as client:
        found = target.choose(client)
        before = found.model().model
        named = purpose or protocol or "quick"
        folder = out or target.config.studies / f"{found.name}-{participant}-{named}"
        spec = _spec(
            found.name,
            participant,
            _protocol(protocol, purpose, precision, no_prior),
            session,
            seed,
            folder,
            target.config.registry.url,
        )
        if not lines:
            typer.echo(f"seed {spec.seed}, in {folder}")
        try:
            with Watching(found, lines) as watching:
                result = run_calibration(
                    spec, folder, client, found.keys.site, watching.tell, lambda: False
                )
        except KeyboardInterrupt:
            sys.stderr.write(f"stopped; what is finished is in {folder}: ask again to go on\n")
            raise
    document = folder / "model.json"
    replace_file(document, result.model.to_json())
    reference = _publish(target.config.registry.url, result.model) if publish else None
    if lines:
        told = result.model_dump(mode="json", by_alias=True)
        write_line(event="result", published=reference, folder=str(folder), **told)
    else:
        _show(result, before, document)
        if reference is not None:
            from frictus_service.registry.database import Database

            where = Database(target.config.registry.url)  # as text: without its password
            typer.echo(
                f"published as {reference} in {where}; "
                f"`frictus models activate {found.name} {reference}`"
            )
        if purpose is not None:
            typer.echo(f"what its model gets wrong: frictus discover {result.study}")


def _protocol(
    name: ProtocolName | None, purpose: str | None, precision: float | None, no_prior: bool
) -> "PaperProtocol | QuickProtocol":
    from frictus.errors import ArgumentError
    from frictus_service.calibration.job import FOR_DISCOVERY, PaperProtocol, QuickProtocol

    if purpose is not None and name is not None:
        raise ArgumentError("--for has a protocol of its own; accepted: --for or --protocol")
    if purpose is None and name != "paper":
        asked = {} if precision is None else {"precision": precision}
        return QuickProtocol.model_validate({**asked, "use_prior": not no_prior})
    if precision is not None or no_prior:
        raise ArgumentError("--precision and --no-prior belong to the quick protocol")
    return PaperProtocol() if purpose is None else FOR_DISCOVERY


def _spec(
    rig: str,
    participant: str,
    protocol: "PaperProtocol | QuickProtocol",
    session: int,
    seed: int | None,
    folder: Path,
    registry: str,
) -> "CalibrationSpec":
    """Return what is asked for; seed and prior of a calibration that goes on are its own."""
    from pydantic import ValidationError

    from frictus.errors import ArgumentError, explain
    from frictus_service.calibration.folder import read_spec
    from frictus_service.calibration.job import CalibrationSpec

    begun = read_spec(folder)
    if begun is not None:
        seed, prior = begun.seed if seed is None else seed, begun.prior
    else:
        seed = secrets.randbits(31) if seed is None else seed
        prior = _prior(registry, participant, protocol)
    try:
        return CalibrationSpec(
            rig=rig,
            participant=participant,
            protocol=protocol,
            session=session,
            seed=seed,
            prior=prior,
        )
    except ValidationError as error:
        raise ArgumentError(explain(error)) from error


def _prior(
    registry: str, participant: str, protocol: "PaperProtocol | QuickProtocol"
) -> "tuple[Model, ...]":
    """Return the earlier people's models that the registry holds."""
    if protocol.kind == "paper" or not protocol.use_prior:
        return ()
    from frictus_service.registry.store import Registry, earlier_people

    with Registry(registry) as opened:
        return earlier_people(opened, besides=participant)


def _publish(registry: str, model: "Model") -> str:
    from frictus_service.cli.models import default_name
    from frictus_service.registry.store import Registry

    rig = str(model.provenance["rig"])
    with Registry(registry) as opened:
        name = default_name(model, rig)
        return opened.publish(model, name, by=whoever_asks(), rig=rig).reference


def _show(result: "CalibrationResult", before: "Model", document: Path) -> None:
    """Say what came of it, beside what the rig applies now."""
    from rich.console import Console
    from rich.table import Table

    from frictus.model import FirstOrderSpeedLaw

    law, old = result.model.base, before.base
    assert isinstance(law, FirstOrderSpeedLaw)
    table = Table("cutoff", "this calibration", "95 %", "the rig's model now")
    for at in result.details["cutoff_hz"]:
        speed, value, half = at["speed_mm_s"], at["value"], at["half_width"]
        now = "-"
        if isinstance(old, FirstOrderSpeedLaw):
            other = old.cutoff_0_hz + old.slope_hz_per_mm_s * speed
            now = f"{other:.0f} Hz ({100.0 * (other / value - 1.0):+.0f} %)"
        table.add_row(f"{speed:g} mm/s", f"{value:.0f} Hz", f"± {100.0 * half:.1f} %", now)
    console = Console()
    console.print(table)
    told = (
        f"gain {law.gain_n:.3g} N, cutoff {law.cutoff_0_hz:.0f} Hz + "
        f"{law.slope_hz_per_mm_s:.2f} Hz per mm/s, delay {1e6 * result.model.skew_s:.0f} us; "
        f"{result.details['trials_used']} of {result.details['trials']} trials, "
        f"{result.recorded_s:.0f} s recorded"
    )
    console.print(told, markup=False)
    if before.placeholder:
        console.print("the rig's model is a placeholder: nobody measured it")
    if not result.reached:
        console.print("[yellow]what was asked for was not reached[/]")
    for note in result.notes:
        console.print(note, markup=False)
    console.print(f"study {result.study}, model {document}", markup=False)
