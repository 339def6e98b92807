"""A damaged file gives the values that were written, or says where it is damaged."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from frictus_service.errors import Exclusion, StudyError
from frictus_service.study.importers import open_study, read_all
from frictus_service.study.layout import digest
from frictus_service.study.reader import StudyReader
from frictus_service.study.trial import Trial

MakeTrial = Callable[..., Trial]
WriteStudy = Callable[..., Path]
N_FLIPS = 80


@pytest.fixture
def written(make_trial: MakeTrial, write_study: WriteStudy) -> tuple[Path, dict[str, str]]:
    trials = [make_trial(f"t{order}", order=order) for order in range(3)]
    return write_study(*trials), {trial.info.id: digest(trial) for trial in trials}


def outcome(path: Path, hashes: dict[str, str]) -> str:
    """Return how reading ended; every trial is accounted for, every value is right."""
    try:
        with StudyReader(path) as study:
            found = list(read_all(study))
    except StudyError:
        return "refused"
    named = {one.trial if isinstance(one, Exclusion) else one.info.id for one in found}
    assert named == set(hashes)
    for one in found:
        if isinstance(one, Trial):
            assert digest(one) == one.sha256 == hashes[one.info.id]
    return "excluded" if any(isinstance(one, Exclusion) for one in found) else "whole"


def test_a_flipped_bit_never_gives_a_wrong_value(
    written: tuple[Path, dict[str, str]], rng: np.random.Generator
) -> None:
    path, hashes = written
    good = path.read_bytes()
    assert outcome(path, hashes) == "whole"
    ends = set()
    for at in rng.integers(len(good), size=N_FLIPS):
        bad = bytearray(good)
        bad[at] ^= 1 << int(rng.integers(8))
        path.write_bytes(bad)
        ends.add(outcome(path, hashes))
    assert "excluded" in ends


@pytest.mark.parametrize("how", ["link to a file", "soft link", "external storage"])
def test_no_study_leads_to_another_file(
    how: str, written: tuple[Path, dict[str, str]], tmp_path: Path
) -> None:
    path, _ = written
    (tmp_path / "secret").write_bytes(np.arange(1_000.0).tobytes())
    with h5py.File(path, "a") as file:
        trial = file["trials/t0"]
        name, shape = "voltage_v", trial["voltage_v"].shape
        del trial[name]
        if how == "external storage":
            at = [(str(tmp_path / "secret"), 0, 8_000)]
            trial.create_dataset(name, shape, "f8", external=at)
        elif how == "soft link":
            trial[name] = h5py.SoftLink("/trials/t1/voltage_v")
        else:
            trial[name] = h5py.ExternalLink(str(path.with_name("other.h5")), "/x")
        del trial.attrs["sha256"]
    with StudyReader(path) as study:
        found = list(read_all(study))
    (left_out,) = [one for one in found if isinstance(one, Exclusion)]
    assert left_out.trial == "t0"
    assert "elsewhere" in str(left_out) or "another file" in str(left_out)


def test_a_lost_sector_never_gives_a_wrong_value(
    written: tuple[Path, dict[str, str]], rng: np.random.Generator
) -> None:
    path, hashes = written
    good = path.read_bytes()
    for _ in range(20):
        at = int(rng.integers(len(good) // 512)) * 512
        lost = bytes(512) if rng.random() < 0.5 else rng.bytes(512)
        path.write_bytes(good[:at] + lost + good[at + 512 :])
        outcome(path, hashes)


def test_a_file_cut_short_is_refused(
    written: tuple[Path, dict[str, str]], rng: np.random.Generator
) -> None:
    path, hashes = written
    good = path.read_bytes()
    for length in {0, 1, 8, len(good) - 1, *rng.integers(len(good), size=20).tolist()}:
        path.write_bytes(good[:length])
        assert outcome(path, hashes) == "refused"


def test_an_edited_trial_is_excluded_until_its_hash_is_deleted(
    make_trial: MakeTrial, write_study: WriteStudy
) -> None:
    path = write_study(make_trial())
    with h5py.File(path, "r+") as file:
        file["trials/a"].attrs["speed_mm_s"] = 80.0
    with StudyReader(path) as study:
        (found,) = read_all(study)
    assert isinstance(found, Exclusion)
    assert "delete the attribute to accept" in found.reason
    with h5py.File(path, "r+") as file:
        del file["trials/a"].attrs["sha256"]
    with StudyReader(path) as study:
        assert study.read("a").info.speed_mm_s == 80.0


def test_a_copy_with_other_attributes_is_excluded_when_all_is_read(
    make_trial: MakeTrial, write_study: WriteStudy
) -> None:
    first = make_trial("first", order=1)
    elsewhere = replace(first.info, id="again", participant="p2", speed_mm_s=80.0)
    path = write_study(make_trial("other", order=0), first, replace(first, info=elsewhere))
    with StudyReader(path) as study:
        assert study.excluded == ()
        found = list(read_all(study))
    assert [one.info.id for one in found if isinstance(one, Trial)] == ["other", "first"]
    (copy,) = (one for one in found if isinstance(one, Exclusion))
    assert (copy.trial, copy.field) == ("again", "data")
    assert "as trial first" in copy.reason


@pytest.mark.parametrize("content", [b"", b"t,force\n", b"\x89HDF\r\n\x1a\n", b"MCAP0"])
def test_what_is_not_hdf5_is_refused(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "study.h5"
    path.write_bytes(content)
    with pytest.raises(StudyError, match=r"study\.h5"):
        open_study(path)


def test_what_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"no\.h5"):
        open_study(tmp_path / "no.h5")
    with pytest.raises(FileNotFoundError, match=r"no\.h5"):
        StudyReader(tmp_path / "no.h5")
    with pytest.raises(StudyError, match="is a folder of no known layout"):
        open_study(tmp_path)
