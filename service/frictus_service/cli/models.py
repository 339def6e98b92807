"""`frictus models`: the registry of models, from the command line."""

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from frictus_service.cli.options import (
    AsJson,
    ConfigFile,
    RouterOption,
    SiteOption,
    TargetRig,
    wants_lines,
    whoever_asks,
    write_line,
    write_out,
)

if TYPE_CHECKING:
    from frictus.model import Model
    from frictus_service.registry.documents import VersionSummary
    from frictus_service.registry.store import Registry

models = typer.Typer(
    no_args_is_help=True,
    help="List, publish, compare and activate models.",
)
Ref = Annotated[
    str, typer.Argument(metavar="REF", help="NAME, NAME@VERSION or NAME@ALIAS: rig1/P01@3.")
]


@contextlib.contextmanager
def registry_of(config: Path | None) -> Iterator["Registry"]:
    """Open the registry that a configuration file names."""
    from frictus_service.config_file import load

    settings = load(config)
    from frictus_service.registry.store import Registry

    with Registry(settings.registry.url) as registry:
        yield registry


@models.command("list")
def list_models(
    name: Annotated[str | None, typer.Option("--name", help="This name only.")] = None,
    participant: Annotated[str | None, typer.Option("--participant", help="Pseudonym.")] = None,
    rig: Annotated[str | None, typer.Option("--rig", help="Measured on this rig.")] = None,
    newest: Annotated[
        bool, typer.Option("--newest", help="The newest version of each name.")
    ] = False,
    limit: Annotated[int, typer.Option("--limit", min=1, max=1_000, help="At most.")] = 50,
    config: ConfigFile = None,
    as_json: AsJson = False,
) -> None:
    """List published versions, newest first."""
    with registry_of(config) as registry:
        page = registry.find(
            name=name, participant=participant, rig=rig, newest=newest, limit=limit
        )
    if wants_lines(as_json):
        for found in page.models:
            write_line(**found.model_dump())
        return
    from rich.console import Console
    from rich.table import Table

    table = Table("reference", "response", "participant", "rig", "published", "by", "comment")
    for found in page.models:
        whose = found.participant or "population"
        table.add_row(
            found.reference,
            found.response,
            _harmless(whose),
            _harmless(found.rig or "") + " (simulated)" * found.simulated,
            _date(found),
            _harmless(found.published_by),
            _harmless(found.comment),
        )
    console = Console(markup=False)
    console.print(table)
    if page.next is not None:
        console.print(f"more than {limit}: --limit, or narrow it down")


@models.command()
def show(reference: Ref, config: ConfigFile = None, as_json: AsJson = False) -> None:
    """Show a published version: the model, its origin, its aliases, what became of it."""
    with registry_of(config) as registry:
        found = registry.get(reference)
        aliases = registry.aliases.of(found.name)
        moves = registry.aliases.moves(found.name, 20)
        activations = registry.activations.of(found.name, 20)
    if wants_lines(as_json):
        write_line(
            **found.model_dump(mode="json", by_alias=True),
            aliases=[alias.model_dump() for alias in aliases],
            moves=[move.model_dump() for move in moves],
            activations=[activation.model_dump() for activation in activations],
        )
        return
    from rich.console import Console

    console = Console(markup=False)
    console.print(f"{found.reference}, published {_date(found)} by {found.published_by}")
    if found.comment:
        console.print(_harmless(found.comment))
    console.print_json(found.model.to_json().decode())
    for alias in aliases:
        console.print(f"@{alias.alias} is version {alias.version}")
    for move in moves:
        was = f"{move.from_version} → " if move.from_version is not None else ""
        told = f"@{move.alias}: {was}{move.to_version} by {move.moved_by}: {move.reason}"
        console.print(_harmless(told))
    for one in activations:
        console.print(f"version {one.version} on rig {one.rig}, by {one.activated_by}")


@models.command()
def publish(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE", help="A model/1 document, or a discovery's report.json."
        ),
    ],
    name: Annotated[
        str | None,
        typer.Option("--name", help="[default: RIG/PARTICIPANT, or population]"),
    ] = None,
    rig: Annotated[
        str | None, typer.Option("--rig", help="Measured on.  [default: as it says itself]")
    ] = None,
    comment: Annotated[str, typer.Option("--comment", help="For people.")] = "",
    config: ConfigFile = None,
    as_json: AsJson = False,
) -> None:
    """Publish a model as the next version of its name; it never changes afterwards."""
    model = read_model(file)
    told = model.provenance.get("rig")
    measured_on = rig or (told if isinstance(told, str) else None)
    with registry_of(config) as registry:
        published = registry.publish(
            model,
            name or default_name(model, measured_on),
            by=whoever_asks(),
            rig=measured_on,
            comment=comment,
        )
    if wants_lines(as_json):
        write_line(
            event="published",
            reference=published.reference,
            etag=published.etag,
            message=published.remark,
        )
    else:
        typer.echo(f"published as {published.reference}")
        if published.remark:
            typer.echo(_harmless(published.remark))


@models.command()
def alias(
    name: Annotated[str, typer.Argument(metavar="NAME@ALIAS", help="rig1/P01@production.")],
    version: Annotated[
        int, typer.Argument(metavar="VERSION", min=1, max=999_999_999, help="To stand for.")
    ],
    reason: Annotated[str, typer.Option("--reason", help="Kept with the move.")] = "",
    config: ConfigFile = None,
    as_json: AsJson = False,
) -> None:
    """Let an alias stand for a version; the audit keeps who moved it, and why."""
    from frictus_service.errors import RegistryNameError
    from frictus_service.registry.documents import parse_reference

    wanted = parse_reference(name)
    if not isinstance(wanted.which, str):
        raise RegistryNameError(f"{name}: name the alias, such as {wanted.name}@production")
    with registry_of(config) as registry:
        before = registry.aliases.get(wanted.name, wanted.which)
        moved = registry.aliases.move(
            wanted.name,
            wanted.which,
            version,
            by=whoever_asks(),
            reason=reason,
            replaces=before.etag if before is not None else None,
        )
    was = before.version if before is not None else None
    if wants_lines(as_json):
        write_line(event="moved", from_version=was, **moved.model_dump())
    else:
        typer.echo(f"{wanted} is version {version}" + (f", was {was}" if was else ""))


@models.command()
def compare(
    a: Annotated[str, typer.Argument(metavar="A", help="Reference.")],
    b: Annotated[str, typer.Argument(metavar="B", help="Reference.")],
    config: ConfigFile = None,
    as_json: AsJson = False,
) -> None:
    """Set two models side by side: parameters, cutoff by speed, 95 % intervals."""
    from frictus_service.registry.comparison import ComparedQuantity
    from frictus_service.registry.comparison import compare as set_side_by_side

    with registry_of(config) as registry:
        found = set_side_by_side(registry.get(a), registry.get(b))
    if wants_lines(as_json):
        write_line(**found.model_dump(mode="json"))
        return
    from rich.console import Console
    from rich.table import Table

    table = Table("", found.a.reference, found.b.reference, "difference", "95 %", "z")
    rows: dict[str, ComparedQuantity] = dict(found.parameters)
    rows |= {f"cutoff at {c.speed_mm_s:g} mm/s, Hz": c for c in found.cutoff_hz}
    for quantity, one in rows.items():
        interval = f"{one.ci95[0]:.4g} … {one.ci95[1]:.4g}" if one.ci95 else "not known"
        z = f"{one.z:.2f}" if one.z is not None else ""
        table.add_row(
            quantity, f"{one.a:.5g}", f"{one.b:.5g}", f"{one.difference:.4g}", interval, z
        )
    console = Console(markup=False)
    console.print(table)
    for effect, where in found.effects.items():
        console.print(_harmless(f"effect {effect}: in {where}"))
    for key, (in_a, in_b) in found.provenance.items():
        console.print(_harmless(f"{key}: {in_a} | {in_b}"))


@models.command()
def activate(
    rig: Annotated[str, typer.Argument(metavar="RIG", help="Name of the rig.")],
    reference: Ref,
    site: SiteOption = None,
    router: RouterOption = None,
    config: ConfigFile = None,
    as_json: AsJson = False,
) -> None:
    """Give a rig a published model, while it is disarmed, and say what it confirmed."""
    import frictus
    from frictus_service.errors import RegistryUnavailableError

    target = TargetRig.of(config, router, site, rig)
    with (
        registry_of(config) as registry,
        frictus.connect(target.router, tls=target.tls) as client,
    ):
        version = registry.get(reference)
        asked = target.choose(client)
        remark = version.remark_on(rig, asked.status().simulated)
        confirmed, remarks = asked.apply_model(version.model)
        try:
            activation = registry.activations.record(
                version, site=target.site, rig=rig, confirmed=confirmed, by=whoever_asks()
            )
        except RegistryUnavailableError as error:
            raise RegistryUnavailableError(
                f"rig {rig} applies {version.reference} now, but that could not be written "
                f"down, so activate it again later: {error}"
            ) from error
    as_published = confirmed == version.etag
    remarks = "; ".join(filter(None, (remarks, remark)))
    if wants_lines(as_json):
        write_line(
            event="activated",
            as_published=as_published,
            message=remarks,
            **activation.model_dump(),
        )
    else:
        told = "as it was published" if as_published else f"but as another model, {confirmed}"
        typer.echo(f"rig {rig} applies {version.reference}, {told}")
        if remarks:
            typer.echo(remarks)


@models.command()
def export(
    reference: Ref,
    file: Annotated[Path, typer.Argument(metavar="FILE", help="To write: .json or .mat.")],
    config: ConfigFile = None,
) -> None:
    """Write a published model to a file, a model/1 document or one for MATLAB."""
    from frictus.errors import ArgumentError

    if file.suffix not in (".json", ".mat"):
        raise ArgumentError(f"{file}: .json and .mat are accepted")
    with registry_of(config) as registry:
        found = registry.get(reference)
    if file.suffix == ".mat":
        from frictus_service.registry.documents import to_mat

        write_out(file, to_mat(found))
    else:
        write_out(file, found.model.to_json())


def read_model(file: Path) -> "Model":
    """Return the model that a file holds; of a discovery's report, the extended one.

    Raises
    ------
    ArgumentError
        If it holds neither a `model/1` nor a `discovery/1` document, or the discovery names no
        cause.
    """
    from pydantic import ValidationError

    from frictus.errors import ArgumentError, explain
    from frictus.model import Model
    from frictus_service import json_text

    text = json_text.read_file(file)
    schema = _schema_of(text)
    try:
        if schema == "discovery/1":
            return _extended_model(file, text)
        return Model.model_validate_json(text, strict=True)
    except ValidationError as error:
        raise ArgumentError(
            f"{file} holds no {schema or 'model/1'} document: {explain(error)}"
        ) from error


def _schema_of(text: bytes) -> str | None:
    import json

    try:
        document = json.loads(text)
    except (ValueError, RecursionError):
        return None  # the model's own error says what is wrong with it
    told = document.get("schema") if isinstance(document, dict) else None
    return told if told in ("model/1", "discovery/1") else None


def _extended_model(file: Path, text: bytes) -> "Model":
    """Return a report's extended model, with the study and the causes as its origin."""
    from frictus.errors import ArgumentError
    from frictus_service.discovery.document import Discovery

    report = Discovery.model_validate_json(text)
    if not report.causes:
        raise ArgumentError(
            f"{file} names no cause, so there is no model to publish that says more than the "
            "one it criticised; publish that one"
        )
    told = report.extended_model.provenance | {
        "study_sha256": report.study.sha256,
        "code_version": report.code_version,
        "settings": {"response": report.response, "seed": report.seed},
        "discovered": {cause.id: cause.verdict for cause in report.causes},
        "trials_used": report.study.trials_used,
    }
    return report.extended_model.model_copy(update={"provenance": told})


def default_name(model: "Model", rig: str | None) -> str:
    """Return the name that a model is published under where none is given.

    Raises
    ------
    ArgumentError
        If it is a participant's, and nobody says on which rig it was measured.
    """
    from frictus.errors import ArgumentError

    if model.participant is None:
        return "population"
    if rig is None:
        raise ArgumentError("on which rig was it measured? Say --rig, or give a --name")
    return f"{rig}/{model.participant}"


def _harmless(text: str) -> str:
    """Return what others wrote without what a terminal would obey."""
    return "".join(each if each.isprintable() or each == "\n" else " " for each in text)


def _date(found: "VersionSummary") -> str:
    from datetime import UTC, datetime

    return datetime.fromtimestamp(1e-9 * found.published_utc_ns, UTC).strftime("%F %H:%M")
