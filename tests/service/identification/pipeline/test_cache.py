"""What the cache returns is what was put in, or nothing."""

from dataclasses import fields, replace
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from tests.service.identification.trials import STUDY, Made, trial

from frictus_hardware.physics.linear import TransferFunction
from frictus_service.discovery.evidence.trial_evidence import EVIDENCE
from frictus_service.identification.observation.observe import observe
from frictus_service.identification.observation.response import (
    ResponseRows,
    TrialObservations,
)
from frictus_service.identification.pipeline import cache as caching
from frictus_service.identification.pipeline.cache import Cache
from frictus_service.identification.pipeline.study import OBSERVER
from frictus_service.identification.pipeline.workers import Reader, Reading
from frictus_service.study.file_state import state_of

OBSERVING = "frictus_service.identification.observation."


@pytest.fixture
def seen(rng: np.random.Generator) -> TrialObservations:
    return replace(observe(trial(Made((100.0, 300.0)), rng), STUDY), sha256="ab12")


def same(one: TrialObservations, other: TrialObservations) -> bool:
    """Return whether two are equal to the last bit."""
    plain = all(
        repr(getattr(one, field.name)) == repr(getattr(other, field.name))
        for field in fields(TrialObservations)
        if field.name != "rows"
    )
    return plain and all(
        getattr(one.rows, field.name).tobytes() == getattr(other.rows, field.name).tobytes()
        for field in fields(ResponseRows)
    )


def test_round_trip(tmp_path: Path, seen: TrialObservations) -> None:
    cache = Cache(tmp_path / "made" / "here", OBSERVER)
    assert cache.find("ab12", seen.info, STUDY) is None
    cache.keep(Reading(seen), STUDY)
    found = cache.find("ab12", seen.info, STUDY)
    assert found is not None
    assert same(found.observed, seen)
    assert not list(tmp_path.rglob("*.part"))


def test_nothing_measured_round_trips(tmp_path: Path, seen: TrialObservations) -> None:
    empty = ResponseRows(
        **{f.name: getattr(seen.rows, f.name)[:0] for f in fields(ResponseRows)}
    )
    unusable = replace(
        seen,
        valid=False,
        reasons=("mean 0.3 N, ±10 %",),
        mean_speed_mm_s=np.nan,
        rows=empty,
    )
    Cache(tmp_path, OBSERVER).keep(Reading(unusable), STUDY)
    found = Cache(tmp_path, OBSERVER).find("ab12", seen.info, STUDY)
    assert found is not None
    assert same(found.observed, unusable)


def test_another_id_is_taken_over(tmp_path: Path, seen: TrialObservations) -> None:
    Cache(tmp_path, OBSERVER).keep(Reading(seen), STUDY)
    found = Cache(tmp_path, OBSERVER).find("ab12", replace(seen.info, id="copy"), STUDY)
    assert found is not None
    assert found.observed.info.id == "copy"


def test_what_matters_is_in_the_key(
    tmp_path: Path, seen: TrialObservations, monkeypatch: pytest.MonkeyPatch
) -> None:
    cache = Cache(tmp_path, OBSERVER)
    cache.keep(Reading(seen), STUDY)
    assert cache.find("ab13", seen.info, STUDY) is None
    assert cache.find("ab12", seen.info, replace(STUDY, mount=None)) is None
    other = TransferFunction((1.0,), (1.0, 2.0))
    assert cache.find("ab12", seen.info, replace(STUDY, mount=other)) is None
    assert cache.find("ab12", seen.info, replace(STUDY, screen_peak_v=110.0)) is None
    assert cache.find("ab12", seen.info, replace(STUDY, carrier_hz=9000.0)) is None
    assert cache.find("ab12", seen.info, replace(STUDY, rig="elsewhere")) is not None
    monkeypatch.setattr(caching, "estimator_version", lambda: "another")
    assert cache.find("ab12", seen.info, STUDY) is None


@pytest.mark.parametrize("reader", [OBSERVER, EVIDENCE], ids=lambda reader: reader.name)
def test_what_observations_call_is_among_the_sources(
    reader: Reader, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []
    monkeypatch.setattr(caching, "version_of", asked.extend)
    caching.estimator_version()
    hashed = {*asked, *reader.sources}
    called = {
        str(getattr(value, "__module__", None))
        for name in hashed
        for value in vars(import_module(name)).values()
    }
    observing = {name for name in called if name.startswith(OBSERVING)}
    assert observing
    assert observing <= hashed


def test_readers_do_not_share_entries(tmp_path: Path, seen: TrialObservations) -> None:
    Cache(tmp_path, OBSERVER).keep(Reading(seen), STUDY)
    other = Reader("others", OBSERVER.read, (__name__,))
    assert Cache(tmp_path, other).find("ab12", seen.info, STUDY) is None


def test_tables_round_trip(
    tmp_path: Path, seen: TrialObservations, rng: np.random.Generator
) -> None:
    few = np.zeros(3, dtype=[("number", np.int64), ("ratio", np.complex128)])
    few["number"], few["ratio"] = rng.integers(9, size=3), rng.standard_normal(3) + 1j
    more = {"none": few[:0], "few": few}
    Cache(tmp_path, OBSERVER).keep(Reading(seen, more), STUDY)
    found = Cache(tmp_path, OBSERVER).find("ab12", seen.info, STUDY)
    assert found is not None
    assert same(found.observed, seen)
    assert list(found.more) == ["none", "few"]
    for name, table in more.items():
        assert found.more[name].dtype == table.dtype
        np.testing.assert_array_equal(found.more[name], table)


def test_a_damaged_entry_is_none(
    tmp_path: Path, seen: TrialObservations, rng: np.random.Generator
) -> None:
    cache = Cache(tmp_path, OBSERVER)
    cache.keep(Reading(seen), STUDY)
    (entry,) = tmp_path.rglob("*.observations")
    whole = entry.read_bytes()
    for at in rng.integers(len(whole), size=20):
        entry.write_bytes(whole[:at])
        assert cache.find("ab12", seen.info, STUDY) is None
        flipped = bytearray(whole)
        flipped[at] ^= 1 << int(rng.integers(8))
        entry.write_bytes(flipped)
        assert cache.find("ab12", seen.info, STUDY) is None


def test_contents_hold_for_one_state_of_the_file(tmp_path: Path) -> None:
    cache, file = Cache(tmp_path / "cache", OBSERVER), tmp_path / "study.h5"
    file.write_bytes(b"one")
    before = state_of(file)
    cache.keep_contents(before, {"t0": "ab12"})
    assert cache.contents(state_of(file)) == {"t0": "ab12"}
    file.write_bytes(b"other")
    assert cache.contents(state_of(file)) == {}
