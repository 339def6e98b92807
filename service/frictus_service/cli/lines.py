"""JSON lines on standard output."""

import json
import sys
from typing import Any


def write_line(**fields: Any) -> None:
    """Write one object as one line, at once."""
    sys.stdout.write(json.dumps(fields, allow_nan=False) + "\n")
    sys.stdout.flush()
