"""Names, references, keys and provenance: what is taken and what is refused."""

from collections.abc import Callable

import pytest

from frictus.model import Model
from frictus_service.errors import ProvenanceError, RegistryNameError
from frictus_service.registry.database import Once
from frictus_service.registry.documents import (
    Reference,
    check_name,
    check_provenance,
    parse_reference,
)


@pytest.mark.parametrize("name", ["a", "population", "rig1/P01", "R.2_b-c/0", "x" * 64])
def test_names_that_models_have(name: str) -> None:
    assert check_name(name) == name
    for which in (None, 1, 17, 999_999_999, "production", "a-1_b"):
        reference = Reference(name, which)
        assert parse_reference(str(reference)) == reference


@pytest.mark.parametrize(
    "name",
    [
        "",
        "a/b/c",
        "/a",
        "a/",
        "../x",
        ".x",
        "a b",
        "a@1",
        "é",
        "x" * 65,
        "a/audit",
        "compare",
        "a\n",
    ],
)
def test_names_that_no_model_has(name: str) -> None:
    with pytest.raises(RegistryNameError, match="accepted"):
        check_name(name)


@pytest.mark.parametrize(
    "which", ["", "0", "01", "-1", "1.5", "Production", "a" * 33, "1 ", "1@2", "10" * 5]
)
def test_references_that_mean_nothing(which: str) -> None:
    with pytest.raises(RegistryNameError):
        parse_reference(f"a@{which}")


def test_fingerprints_do_not_run_together() -> None:
    assert Once.of("k", b"ab", b"c") != Once.of("k", b"a", b"bc")
    assert Once.of("k", b"ab", b"c") == Once.of("k", b"ab", b"c")


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"placeholder": True}, "placeholder"),
        ({"provenance": {}}, "study_sha256"),
        ({"provenance": {"source": "  "}}, "source"),
        ({"provenance": {"study_sha256": "abc"}}, "64"),
        ({"provenance": {"study_sha256": []}}, "64"),
        ({"provenance": {"study_sha256": "a" * 64}}, "code_version"),
        ({"provenance": {"study_sha256": ["a" * 64], "code_version": "1"}}, "settings"),
    ],
)
def test_provenance_is_asked_for(
    model: Callable[..., Model], change: dict[str, object], reason: str
) -> None:
    check_provenance(model())
    with pytest.raises(ProvenanceError, match=reason):
        check_provenance(model(**change))
