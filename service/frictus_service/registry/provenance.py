"""What a model must say of its origin before it is published."""

import re
from typing import Any, Final

from frictus.model import Model
from frictus_service.registry.errors import ProvenanceError

_SHA256: Final = re.compile(r"[0-9a-f]{64}", re.ASCII)


def check_provenance(model: Model) -> None:
    """Check that a model says where it comes from.

    One that was identified from a study names the study's hash, the code and its settings; any
    other names its ``source`` in words. Whom it is of and where it is valid stand in the model.

    Parameters
    ----------
    model : Model
        Its ``provenance`` is looked at: ``study_sha256`` (one or a list), ``code_version``,
        ``settings`` and, where chance was involved, ``seed``; or ``source``.

    Raises
    ------
    ProvenanceError
        If something is missing, or the model is a placeholder.
    """
    if model.placeholder:
        raise ProvenanceError(
            "a placeholder is not published: nobody measured it; calibrate, or clear "
            "`placeholder` and name the `source` in its provenance"
        )
    told = model.provenance
    if "study_sha256" not in told:
        if not _is_text(told.get("source")):
            raise ProvenanceError(
                "provenance needs `study_sha256`, `code_version` and `settings` of the "
                "analysis, or `source` with a text that says where the model comes from"
            )
        return
    hashes = told["study_sha256"]
    listed = hashes if isinstance(hashes, list | tuple) else [hashes]
    if not listed or not all(_is_text(h) and _SHA256.fullmatch(h) for h in listed):
        raise ProvenanceError(
            "provenance.study_sha256 must be 64 lower-case hexadecimal digits, or a list of it"
        )
    if not _is_text(told.get("code_version")):
        raise ProvenanceError("provenance.code_version must name the version of the code")
    if not isinstance(told.get("settings"), dict):
        raise ProvenanceError("provenance.settings must be an object: what was set")


def _is_text(value: Any) -> bool:
    return isinstance(value, str) and bool(value.strip())
