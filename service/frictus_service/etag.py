"""The hash by which everybody names a scene or a model: rig, API and registry."""

import hashlib
import json

from pydantic import BaseModel


def etag_of(message: BaseModel) -> str:
    """Return a short hash of what a message says, whatever the order of its keys."""
    content = message.model_dump(mode="json", by_alias=True)
    canonical = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(canonical.encode()).hexdigest()[:16]
