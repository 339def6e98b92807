"""What a discovery leaves behind: report, document, and the extended model."""

import json
from pathlib import Path
from typing import Final

from frictus_service.discovery.document import Discovery
from frictus_service.durable import replace_file

REPORT: Final = "report.html"
DOCUMENT: Final = "report.json"
MODEL: Final = "extended_model.json"


def write(found: Discovery, folder: Path) -> list[Path]:
    """Write report, document and extended model, over what stands there; return their paths.

    Parameters
    ----------
    found : Discovery
        The document of a discovery.
    folder : Path
        Made where it is missing.
    """
    from frictus_service.discovery.report.page import render

    folder.mkdir(parents=True, exist_ok=True)
    model = json.dumps(json.loads(found.extended_model.to_json()), indent=2)
    contents = {
        folder / REPORT: render(found).encode(),
        folder / DOCUMENT: found.to_json(),
        folder / MODEL: model.encode(),
    }
    for path, content in contents.items():
        replace_file(path, content)
    return list(contents)
