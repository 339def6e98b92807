"""From raw samples to the report, on a dask scheduler and two workers in other processes."""

import json
from pathlib import Path

import numpy as np
import pytest
from tests.blind.generator.case import Case, Design, Hidden
from tests.blind.generator.study import Seeds, make_study
from tests.service.discovery.across_studies.cluster import cluster
from typer.testing import CliRunner

from frictus_service.cli.app import app
from frictus_service.discovery.across_studies.document import AcrossStudies
from frictus_service.discovery.jobs import DiscoveryProgress, DiscoverySpec, carry_out

pytestmark = [pytest.mark.long, pytest.mark.timeout(900)]
pytest.importorskip("distributed")

DESIGN = Design(participants=6, n_tones=3, n_speeds=2, n_forces=1, tones_per_trial=3)
DELAYS_S = (0.0, 20e-6, 0.0)


def test_on_a_cluster_as_here(tmp_path: Path, rng: np.random.Generator) -> None:
    studies = tmp_path / "laboratories"
    for number, delay_s in enumerate(DELAYS_S):
        place = studies / f"laboratory{number}" / "visit.h5"
        place.parent.mkdir(parents=True)
        hidden = (
            Hidden("direction_asymmetry", {"share": 0.1}),
            Hidden("channel_delay", {"delay_s": delay_s}),
        )
        drawn = Seeds(*(int(seed) for seed in rng.integers(2**31, size=2)))
        make_study(place, Case("test", hidden, DESIGN), drawn)
    (studies / "broken.h5").write_bytes(b"no study")
    words = ["discover", str(studies), "--seed", "7", "--out"]
    with cluster(2) as address:
        there = CliRunner().invoke(app, [*words, str(tmp_path / "a"), "--cluster", address])
    assert there.exit_code == 0, there.output
    assert "2 threads of the cluster" in there.stderr
    here = CliRunner().invoke(app, [*words, str(tmp_path / "b"), "--workers", "0"])
    assert here.exit_code == 0, here.output
    found, other = (
        AcrossStudies.model_validate_json((tmp_path / name / "report.json").read_bytes())
        for name in "ab"
    )
    assert found == other
    # And as a job, beside the observations of the latter.
    names = tuple(f"laboratory{number}/visit.h5" for number in range(3))
    told: list[DiscoveryProgress] = []
    job = tmp_path / "b" / "job"
    job.mkdir()
    spec = DiscoverySpec(study=("broken.h5", *names), seed=7)
    paths = [studies / name for name in spec.studies]
    result = carry_out(spec, paths, job, told.append, lambda: False)
    as_job = AcrossStudies.model_validate_json((job / "report.json").read_bytes())
    assert (as_job.causes, as_job.studies) == (found.causes, found.studies)
    assert (result.verdict, result.sentence) == (None, found.sentence)
    assert result.causes == tuple(each.id for each in found.causes if each.in_model)
    assert told[-1].message == "writing the report"
    printed = json.loads(there.stdout)
    assert printed["sentence"] == found.sentence
    assert [each.name for each in found.studies] == [
        f"laboratory{number}/visit" for number in range(3)
    ]
    assert [Path(each.path).name for each in found.left_out] == ["broken.h5"]
    (delay,) = [each for each in found.causes if each.id == "channel_delay"]
    assert [each.value for each in delay.studies] == pytest.approx(DELAYS_S, abs=2e-6)
