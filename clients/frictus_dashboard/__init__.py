"""The dashboard: a page of plain ES modules and CSS, which the API process serves."""

from pathlib import Path
from typing import Final

FOLDER: Final = Path(__file__).parent / "static"
"""Everything below it is served as it is, below ``/dashboard/``."""
