"""What a registry promises, on either database."""

import contextlib
import sqlite3
import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from sqlalchemy import text
from sqlalchemy.exc import IntegrityError

from frictus.model import FirstOrderSpeedLaw, MassSpringDamper, Model
from frictus_service.errors import (
    KeyReusedError,
    ProvenanceError,
    RegistryNameError,
    RegistryUnavailableError,
    UnknownCalibrationError,
    UnknownModelError,
)
from frictus_service.json_text import etag_of
from frictus_service.registry import tables
from frictus_service.registry.database import Once
from frictus_service.registry.store import Registry

MakeModel = Callable[..., Model]


def test_versions_count_up_under_each_name(registry: Registry, model: MakeModel) -> None:
    first = registry.publish(model(0.3), "rig1/P01", by="ann", rig="rig1", comment="first")
    second = registry.publish(model(0.4), "rig1/P01", by="ben")
    other = registry.publish(model(0.5, participant=None), "population", by="ann")
    assert [m.reference for m in (first, second, other)] == [
        "rig1/P01@1",
        "rig1/P01@2",
        "population@1",
    ]
    assert registry.get("rig1/P01@1") == first
    assert registry.get("rig1/P01") == second
    assert (first.rig, first.comment, first.published_by) == ("rig1", "first", "ann")
    assert first.participant == "P01"
    assert other.participant is None


def test_what_is_to_be_said_of_a_model_on_a_rig(registry: Registry, model: MakeModel) -> None:
    own = registry.publish(model(), "rig1/P01", by="ann", rig="rig1")
    assert own.remark_on("rig1", simulated_rig=False) == ""
    assert "measured on rig 'rig1', not on 'rig2'" in own.remark_on("rig2", simulated_rig=False)
    lent = registry.publish(model(participant="P02"), "rig1/P01", by="ann", rig="rig1")
    assert "'P02', though 'rig1/P01' reads as one of 'P01'" in lent.remark_on(
        "rig1", simulated_rig=False
    )
    virtual = model().model_copy(
        update={"provenance": model().provenance | {"simulated": True}}
    )
    drawn = registry.publish(virtual, "rig1/P01", by="ann", rig="rig1")
    assert drawn.remark_on("rig1", simulated_rig=True) == ""
    assert "a simulated rig measured it" in drawn.remark_on("rig1", simulated_rig=False)
    assert [found.simulated for found in registry.find().models] == [True, False, False]
    everybody = registry.publish(model(participant=None), "rig1/all", by="ann", rig="rig1")
    assert everybody.remark_on("rig1", simulated_rig=False) == ""


def test_what_is_got_is_what_was_published(registry: Registry, model: MakeModel) -> None:
    published = model(from_the_future={"kept": [1, 2.5, None]})
    registry.publish(published, "population", by="ann")
    got = registry.get("population@1")
    assert got.model.to_json() == published.to_json()
    assert got.etag == etag_of(got.model) == etag_of(published)


def test_survives_being_closed(url: str, model: MakeModel) -> None:
    with Registry(url) as before:
        said = before.publish(model(), "a", by="ann")
    with Registry(url) as after:
        assert after.get("a@1") == said


def test_unknown_is_told_with_what_there_is(registry: Registry, model: MakeModel) -> None:
    registry.publish(model(), "a", by="ann")
    for reference in ("b", "a@2", "a@production", "a@999999999"):
        with pytest.raises(UnknownModelError, match=r"nothing was published|versions 1 to 1"):
            registry.get(reference)


def test_what_is_refused_is_not_there(registry: Registry, model: MakeModel) -> None:
    with pytest.raises(RegistryNameError):
        registry.publish(model(), "a@1", by="ann")
    with pytest.raises(ProvenanceError):
        registry.publish(model(provenance={}), "a", by="ann")
    assert not registry.find().models


def test_source_in_words_is_provenance_too(registry: Registry, model: MakeModel) -> None:
    literature = model(provenance={"source": "values of the paper, Table 1"})
    assert registry.publish(literature, "paper", by="ann").version == 1


@pytest.fixture
def filled(registry: Registry, model: MakeModel) -> Registry:
    for number in range(5):
        for person in ("P01", "P02"):
            registry.publish(
                model(0.1 * (number + 1), person), f"rig1/{person}", by="a", rig="rig1"
            )
    registry.publish(model(participant=None), "population", by="ann")
    mobility = {"mass_kg": 1e-4, "damping_n_s_m": 0.3, "stiffness_n_m": 800.0}
    skin = model(response="mobility", base=MassSpringDamper.model_validate(mobility))
    registry.publish(skin, "rig2/P01", by="ann", rig="rig2")
    return registry


def test_filters(filled: Registry) -> None:
    def found(**wanted: object) -> list[str]:
        return [m.reference for m in filled.find(**wanted).models]  # type: ignore[arg-type]

    assert found(name="rig1/P02") == [f"rig1/P02@{n}" for n in (5, 4, 3, 2, 1)]
    assert found(participant="P01", newest=True) == ["rig2/P01@1", "rig1/P01@5"]
    assert found(participant="P01", newest=True, rig="rig1") == ["rig1/P01@5"]
    assert found(population=True) == ["population@1"]
    assert len(found(population=False)) == 11
    assert found(response="mobility") == ["rig2/P01@1"]
    assert found(newest=True, limit=2) == ["rig2/P01@1", "population@1"]
    assert found(participant="nobody") == []


@pytest.mark.parametrize("limit", [1, 5, 12])
def test_pages_give_each_version_once(filled: Registry, model: MakeModel, limit: int) -> None:
    whole = filled.find(limit=100)
    assert whole.next is None
    seen, after = [], 0
    while True:
        page = filled.find(after=after, limit=limit)
        seen += page.models
        if page.next is None:
            break
        after = page.next
        filled.publish(model(), "newcomer", by="ann")  # does not shift what is still to come
    assert seen == whole.models


def test_published_rows_are_immutable_for_everybody(
    registry: Registry, model: MakeModel
) -> None:
    said = registry.publish(model(), "a", by="ann")
    registry.aliases.move("a", "production", 1, by="ann", replaces=None)
    registry.activations.record(said, site="lab", rig="rig1", confirmed=said.etag, by="ann")
    changes = [
        f"{change} {table.name}{how}"
        for table in (tables.models, tables.alias_moves, tables.activations)
        for change, how in (("UPDATE", " SET name = name"), ("DELETE FROM", ""))
    ]
    if not str(registry.database).startswith("sqlite"):
        changes.append("TRUNCATE models CASCADE")
    for change in changes:
        with (
            pytest.raises(IntegrityError, match="immutable"),
            registry.database.write() as connection,
        ):
            connection.execute(text(change))
    assert registry.get("a@1") == said
    assert len(registry.aliases.moves("a", 9)) == len(registry.activations.of("a", 9)) == 1


def test_a_row_cannot_take_the_place_of_another(registry: Registry, model: MakeModel) -> None:
    if not str(registry.database).startswith("sqlite"):
        pytest.skip("only SQLite has INSERT OR REPLACE")
    said = registry.publish(model(), "a", by="ann")
    for columns in ("id, name, version", "id + 1, name, version"):
        replace = (
            f"INSERT OR REPLACE INTO models SELECT {columns}, 'x', response, participant, rig, "
            "document, published_utc_ns, published_by, comment, calibration, simulated "
            "FROM models"
        )
        with (
            pytest.raises(IntegrityError, match="immutable"),
            registry.database.write() as connection,
        ):
            connection.execute(text(replace))
    assert registry.get("a@1") == said


def test_same_request_is_carried_out_once(url: str, model: MakeModel) -> None:
    once = Once.of("key-1", b"POST", b"body")
    with Registry(url) as before:
        first = before.publish(model(0.3), "a", by="ann", once=once)
        before.publish(model(0.4), "a", by="ann")
    with Registry(url) as after:  # the key outlives the process
        assert after.publish(model(0.3), "a", by="ann", once=once) == first
        with pytest.raises(KeyReusedError, match="key-1"):
            after.publish(model(0.3), "a", by="ann", once=Once.of("key-1", b"POST", b"other"))
        assert len(after.find(name="a").models) == 2


def test_a_refused_request_does_not_use_up_its_key(
    registry: Registry, model: MakeModel
) -> None:
    once = Once.of("key-2", b"x")
    with pytest.raises(UnknownCalibrationError):
        registry.publish(model(), "a", by="ann", calibration="none", once=once)
    assert registry.publish(model(), "a", by="ann", once=once).version == 1


def test_threads_with_one_key_publish_one_version(registry: Registry, model: MakeModel) -> None:
    once, said = Once.of("key", b"x"), []

    def publish() -> None:
        said.append(registry.publish(model(), "a", by="ann", once=once).reference)

    threads = [threading.Thread(target=publish) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60.0)
    assert said == ["a@1"] * 8
    assert registry.get("a").version == 1


def test_random_models_come_back(
    registry: Registry, model: MakeModel, rng: np.random.Generator
) -> None:
    sent = []
    for gain, cutoff, slope in rng.uniform(0.01, 50.0, (20, 3)):
        law = FirstOrderSpeedLaw(gain_n=gain, cutoff_0_hz=cutoff, slope_hz_per_mm_s=slope)
        sent.append(registry.publish(model(base=law), "random", by="ann"))
    for said in sent:
        assert registry.get(said.reference).model.base == said.model.base


def test_nothing_is_made_before_the_first_use(tmp_path: Path) -> None:
    with Registry(f"sqlite:///{tmp_path / 'none.db'}") as registry:
        assert not registry.database.exists
        assert not list(tmp_path.iterdir())
        registry.find()
        assert registry.database.exists


@pytest.mark.parametrize(
    "url",
    [
        "sqlite:////nowhere/at/all/x.db",
        "postgresql+psycopg://u:secret@127.0.0.1:1/x",
        "not a url",
        "oracle://x",
    ],
)
def test_unreachable_is_told_without_the_password(url: str) -> None:
    with pytest.raises(RegistryUnavailableError) as told:
        Registry(url).find()
    assert "secret" not in str(told.value)
    assert "registry.url" in str(told.value)


def test_a_model_that_this_version_cannot_read_is_named(
    tmp_path: Path, model: MakeModel
) -> None:
    file = tmp_path / "x.db"
    with Registry(f"sqlite:///{file}") as registry:
        registry.publish(model(), "a", by="ann")
        with contextlib.closing(sqlite3.connect(file)) as changed:
            changed.execute("DROP TRIGGER models_no_update")
            changed.execute("UPDATE models SET document = '{}'")
            changed.commit()
        with pytest.raises(RegistryUnavailableError, match=r"a@1 in a form .*base: .* update"):
            registry.get("a")
