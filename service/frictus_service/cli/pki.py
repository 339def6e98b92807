"""`frictus pki`: certificates for the members of a network, by role."""

import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from frictus_service.cli.options import AsJson, Exit, wants_lines, write_line

if TYPE_CHECKING:
    from frictus_service.security.files import Shown

pki = typer.Typer(
    no_args_is_help=True,
    help="Make and show certificates of rigs, controllers and observers.",
)

Folder = Annotated[
    Path, typer.Option("--folder", metavar="DIR", help="Where certificates and keys stand.")
]


@pki.command()
def create(
    folder: Folder = Path("pki"),
    name: Annotated[str, typer.Option("--name", help="Name of the authority.")] = "frictus",
    days: Annotated[
        int, typer.Option("--days", min=1, max=36_500, help="How long it lasts.")
    ] = 3_650,
    as_json: AsJson = False,
) -> None:
    """Make the authority that signs every certificate of a lab: ca.pem, and its key ca.key."""
    from frictus_service.security.authority import make_authority
    from frictus_service.security.files import AUTHORITY, write

    made = make_authority(name, _now(), datetime.timedelta(days=days))
    _tell_made(*write(made, folder, AUTHORITY), as_json)


@pki.command()
def issue(
    role: Annotated[
        str, typer.Argument(metavar="ROLE", help="router, rig, controller or observer.")
    ],
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME", help="Whose it is; of a rig SITE/RIG as configured, as lab/rig1."
        ),
    ],
    host: Annotated[
        list[str] | None,
        typer.Option("--host", help="Address or name of a router, which needs it; repeat."),
    ] = None,
    folder: Folder = Path("pki"),
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Where to.  [default: the authority's]"),
    ] = None,
    days: Annotated[
        int, typer.Option("--days", min=1, max=3_650, help="How long it lasts.")
    ] = 365,
    as_json: AsJson = False,
) -> None:
    """Make a certificate and its key, signed by the authority in the folder.

    Such as: issue router hall --host 192.168.1.10; issue rig lab/rig1; issue controller alice.
    """
    from frictus_service.security import authority
    from frictus_service.security.files import read_authority, write
    from frictus_service.security.members import Member

    member = Member(role, name)  # type: ignore[arg-type]  # checked on the way in
    signer = read_authority(folder)
    lasts = datetime.timedelta(days=days)
    made = authority.issue(signer, member, host or [], _now(), lasts)
    _tell_made(*write(made, out or folder, member.stem), as_json)


@pki.command()
def show(
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Certificates.")],
    as_json: AsJson = False,
) -> None:
    """Tell whose certificates these are, in which role, and until when; 6 if one is over."""
    from frictus_service.security import files as certificates

    now = _now()
    told = [(file, certificates.show(file)) for file in files]
    if wants_lines(as_json):
        for file, shown in told:
            write_line(file=str(file), **_fields(shown, now))
    else:
        _print(told, now)
    if any(shown.state(now) != "valid" for _, shown in told):
        raise typer.Exit(Exit.CHECK_FAILED)


def _now() -> datetime.datetime:
    return datetime.datetime.now(datetime.UTC)


def _tell_made(certificate: Path, key: Path, as_json: bool) -> None:
    from frictus_service.security.files import guarded, show

    ends = show(certificate).ends
    if wants_lines(as_json):
        write_line(certificate=str(certificate), key=str(key), ends=ends.isoformat())
    else:
        typer.echo(f"{certificate}: valid until {ends:%Y-%m-%d}")
        typer.echo(f"{key}: the private key, {guarded(key)}")


def _fields(shown: "Shown", now: datetime.datetime) -> dict[str, object]:
    member = shown.member
    return {
        "role": "authority" if shown.authority else member.role if member else None,
        "name": member.name if member else shown.common_name,
        "issuer": shown.issuer,
        "hosts": list(shown.hosts),
        "begins": shown.begins.isoformat(),
        "ends": shown.ends.isoformat(),
        "state": shown.state(now),
    }


def _print(told: "list[tuple[Path, Shown]]", now: datetime.datetime) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table("file", "role", "name", "hosts", "signed by", "until", "state")
    for file, shown in told:
        fields = _fields(shown, now)
        table.add_row(
            str(file),
            str(fields["role"] or "not one of ours"),
            str(fields["name"]),
            ", ".join(shown.hosts),
            shown.issuer,
            f"{shown.ends:%Y-%m-%d %H:%M} UTC",
            shown.state(now),
        )
    Console(markup=False).print(table)
