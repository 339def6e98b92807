"""What may be published under which name, and what the registry answers with.

Names of models, and references to one version of them.

A name has one or two parts: ``population``, ``rig1/P01``. A reference is ``rig1/P01@3`` (a
version), ``rig1/P01@production`` (an alias) or ``rig1/P01`` (the newest version).
"""

import io
import json
import re
from dataclasses import dataclass
from typing import Annotated, Any, Final, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from frictus.model import Model
from frictus_service.calibration.job import CalibrationResult, CalibrationSpec, Progress
from frictus_service.errors import ProvenanceError, RegistryNameError
from frictus_service.job_folder import State

_PART: Final = r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}"
NAME: Final = rf"{_PART}(/{_PART})?"
ALIAS: Final = "[a-z][a-z0-9_-]{0,31}"
_WHICH: Final = "[1-9][0-9]{0,8}"
REFERENCE: Final = rf"{NAME}(@({_WHICH}|{ALIAS}))?"
"""Names, aliases and references, as patterns."""
_NAME: Final = re.compile(NAME, re.ASCII)
_ALIAS: Final = re.compile(ALIAS, re.ASCII)
_VERSION: Final = re.compile(_WHICH, re.ASCII)
RESERVED: Final = frozenset({"aliases", "audit", "compare", "model.json", "model.mat"})
"""Parts that no name may have: the REST paths below a model's end with them."""


@dataclass(frozen=True, slots=True)
class Reference:
    """Which version is meant.

    Attributes
    ----------
    name : str
        Name of the model.
    which : int, str or None
        Version, alias, or None for the newest.
    """

    name: str
    which: int | str | None

    def __str__(self) -> str:
        """Return the reference as people write it."""
        return self.name if self.which is None else f"{self.name}@{self.which}"


def check_name(name: str) -> str:
    """Return the name of a model.

    Raises
    ------
    RegistryNameError
        If no model can have it.
    """
    if not _NAME.fullmatch(name) or RESERVED.intersection(name.split("/")):
        raise RegistryNameError(
            f"model name {name[:150]!r}: one or two parts joined by '/' are accepted, such as "
            "'population' or 'rig1/P01', each 1 to 64 letters, digits, '.', '_' and '-' "
            f"beginning with a letter or digit; not {', '.join(sorted(RESERVED))}"
        )
    return name


def check_alias(alias: str) -> str:
    """Return the name of an alias.

    Raises
    ------
    RegistryNameError
        If no alias can have it.
    """
    if not _ALIAS.fullmatch(alias):
        raise RegistryNameError(
            f"alias {alias[:80]!r}: 1 to 32 lower-case letters, digits, '_' and '-' beginning "
            "with a letter are accepted, such as 'production'"
        )
    return alias


def parse_reference(text: str) -> Reference:
    """Return what ``NAME``, ``NAME@VERSION`` or ``NAME@ALIAS`` stands for.

    Raises
    ------
    RegistryNameError
        If it is none of them.
    """
    name, at, which = text.partition("@")
    check_name(name)
    if not at:
        return Reference(name, None)
    if _VERSION.fullmatch(which):
        return Reference(name, int(which))
    return Reference(name, check_alias(which))


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


class _Document(BaseModel):
    model_config = ConfigDict(frozen=True)


class VersionSummary(_Document):
    """A published version, without the model itself."""

    name: str
    version: int
    etag: Annotated[str, Field(description="Of the model; a rig names it when it is active")]
    response: Literal["friction", "mobility"]
    participant: Annotated[str | None, Field(description="Pseudonym; null: population")]
    rig: str | None
    published_utc_ns: int
    published_by: str
    comment: str
    calibration: Annotated[str | None, Field(description="The calibration that measured it")]
    simulated: Annotated[
        bool, Field(description="Whether a simulated rig measured it, as it said of itself")
    ]

    @property
    def reference(self) -> str:
        """``NAME@VERSION``."""
        return f"{self.name}@{self.version}"

    @property
    def remark(self) -> str:
        """What to say of its name; empty where it ends with whose model it is."""
        _, slash, person = self.name.partition("/")
        if not slash or self.participant in (None, person):
            return ""
        return (
            f"it is a model of participant {self.participant!r}, though {self.name!r} reads "
            f"as one of {person!r}: for another finger, activate or publish another name"
        )


class Published(VersionSummary):
    """A published version; it never changes."""

    model: Model

    def remark_on(self, rig: str, simulated_rig: bool) -> str:
        """Return what to say of its use on a rig; empty where nothing is amiss."""
        remarks = [self.remark]
        if self.rig not in (None, rig):
            remarks.append(
                f"it was measured on rig {self.rig!r}, not on {rig!r}: another screen is felt "
                "otherwise; calibrate here, or see that both are alike"
            )
        if self.model.simulated and not simulated_rig:
            remarks.append(
                "a simulated rig measured it, and no finger of a person: calibrate here"
            )
        return "; ".join(filter(None, remarks))


class VersionPage(_Document):
    """Some of the versions, newest first."""

    models: list[VersionSummary]
    next: Annotated[int | None, Field(description="`after` of the next page; null on the last")]


class Alias(_Document):
    """A name that stands for one version until it is moved."""

    name: str
    alias: str
    version: int
    revision: Annotated[int, Field(description="1 when it was made; one more with each move")]
    moved_utc_ns: int

    @property
    def etag(self) -> str:
        """What a mover must have seen."""
        return f"{self.alias}-{self.revision}"


class AliasMove(_Document):
    """One move of an alias; never changed."""

    alias: str
    revision: int
    from_version: int | None
    to_version: int
    moved_utc_ns: int
    moved_by: str
    reason: str


class Activation(_Document):
    """A rig was given a published model; never changed."""

    site: str
    rig: str
    name: str
    version: int
    etag: Annotated[str, Field(description="Of the version that was published")]
    confirmed: Annotated[str, Field(description="Of the model that the rig says it applies")]
    activated_utc_ns: int
    activated_by: str


class Audit(_Document):
    """Who moved which alias of a model, and on which rigs it was activated; newest first."""

    name: str
    moves: list[AliasMove]
    activations: list[Activation]


class Calibration(_Document):
    """One calibration and where it stands."""

    id: str
    site: str
    rig: str
    participant: str
    state: State
    created_utc_ns: int
    created_by: str
    updated_utc_ns: int
    spec: CalibrationSpec
    progress: Progress | None
    result: CalibrationResult | None
    failure: str | None
    published: Annotated[str | None, Field(description="NAME@VERSION of its model")]


class CalibrationPage(_Document):
    """Some of the calibrations, newest first."""

    calibrations: list[Calibration]
    next: Annotated[str | None, Field(description="`after` of the next page; null on the last")]


class CalibrationEvent(_Document):
    """One thing that a calibration told; numbered from 1 without gaps."""

    number: int
    utc_ns: int
    kind: Literal["state", "progress"]
    data: Annotated[str, Field(description="JSON: the state, or the progress")]


def to_mat(published: Published) -> bytes:
    """Return a MATLAB 5 file of a published model; `docs/registry.md` has its variables.

    Parameters
    ----------
    published : Published
        Numbers become doubles, texts char arrays; the whole document stands in ``document`` as
        JSON, so that nothing is lost.
    """
    from scipy.io import savemat  # seconds, and few ask for it

    model = published.model
    base = model.base.model_dump(include=set(type(model.base).model_fields) - {"law"})
    covariance = model.covariance
    names = covariance.parameters if covariance is not None else []
    matrix = covariance.matrix if covariance is not None else np.empty((0, 0))
    variables: dict[str, Any] = {
        "schema": model.schema_,
        "name": published.name,
        "version": float(published.version),
        "etag": published.etag,
        "response": model.response,
        "law": model.base.law,
        "parameters": {name: float(value) for name, value in base.items()},
        "hold_s": model.hold_s,
        "skew_s": model.skew_s,
        "validity": {
            name: np.array(getattr(model.validity, name), dtype=np.float64)
            for name in type(model.validity).model_fields
        },
        "covariance": np.asarray(matrix, dtype=np.float64),
        "covariance_parameters": np.array(names, dtype=object),
        "participant": model.participant or "",
        "published_utc": str(np.datetime64(published.published_utc_ns, "ns")) + "Z",
        "provenance": json.dumps(model.provenance),
        "document": model.to_json().decode(),
    }
    content = io.BytesIO()
    file: Any = content  # the types of some versions of scipy know paths alone
    savemat(file, variables, long_field_names=True, oned_as="row")
    return content.getvalue()
