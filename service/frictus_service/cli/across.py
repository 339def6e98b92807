"""`frictus discover` of several studies: which they are, and what is printed of them."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from frictus_service.cli.options import wants_lines, write_line

if TYPE_CHECKING:
    from rich.console import Console

    from frictus_service.discovery.across_studies.document import AcrossStudies


def studies_of(given: Sequence[Path]) -> list[Path]:
    """Return the studies that are meant: files, and those in folders, one level down at most.

    Raises
    ------
    typer.BadParameter
        If a folder holds no study.
    """
    found: list[Path] = []
    for path in given:
        inside = sorted([*path.glob("*.h5"), *path.glob("*/*.h5")]) if path.is_dir() else []
        if path.is_dir() and not inside and len(given) > 1:
            raise typer.BadParameter(
                f"{path}: no study in this folder; accepted: study files, and folders with "
                "NAME.h5 or LABORATORY/NAME.h5"
            )
        found += inside or [path]
    return found


def folder_of(given: Sequence[Path]) -> Path:
    """Return where results go that are not asked for elsewhere: beside a folder of studies."""
    if len(given) > 1:
        return Path("across-studies")
    return given[0].resolve().with_name(f"{given[0].resolve().name}-discovery")


def show(found: "AcrossStudies", console: "Console") -> None:
    """Print the answer, the causes in the model, and what to know of them.

    Parameters
    ----------
    found : AcrossStudies
        The document.
    console : Console
        Where it is printed.
    """
    from frictus_service.discovery.catalogue.cause import title

    console.print(found.sentence, markup=False, style="bold")
    for cause in found.causes:
        if cause.in_model:
            console.print(f"{title(cause.id)}: {cause.sentence}", markup=False)
    for parameter in found.base_parameters:
        console.print(f"{parameter.id}: {parameter.sentence}", markup=False)
    for study in found.left_out:
        console.print(f"left out: {study.path}: {study.reason}", markup=False)
    for note in found.notes:
        console.print(f"- {note}", markup=False)


def finish(found: "AcrossStudies", folder: Path, as_json: bool) -> None:
    """Write report and document, and print them."""
    from frictus_service.discovery.across_studies import page
    from frictus_service.discovery.document import REPORT

    written = page.write(found, folder)
    if wants_lines(as_json):
        whole = found.model_dump(mode="json", by_alias=True)
        write_line(**whole, files=[str(path) for path in written])
    else:
        from rich.console import Console

        show(found, Console())
        Console().print(f"report: {folder / REPORT}", markup=False, soft_wrap=True)
