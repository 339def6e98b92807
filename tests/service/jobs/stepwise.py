"""A calibration of three trials, each of which waits until a file beside its folder allows it.

Run in processes that the service starts; the participant's pseudonym says what goes wrong.
"""

import os
import time
from collections.abc import Callable
from pathlib import Path

import frictus
from frictus.model import FirstOrderSpeedLaw, Model
from frictus_service.calibration.job import CalibrationResult, CalibrationSpec, Progress
from frictus_service.errors import CalibrationError, CancelledError

TRIALS = 3


def allow(studies: Path, trials: int) -> None:
    """Let calibrations below `studies` do so many trials."""
    studies.mkdir(parents=True, exist_ok=True)
    beside = studies / "allowed.new"
    beside.write_text(str(trials), encoding="ascii")
    os.replace(beside, studies / "allowed")


def run(
    spec: CalibrationSpec,
    folder: Path,
    client: frictus.Client,
    site: str,
    tell: Callable[[Progress], None],
    cancelled: Callable[[], bool],
) -> CalibrationResult:
    """Do what is left of the trials."""
    folder.mkdir(parents=True, exist_ok=True)
    assert site in {found.site for found in client.rigs()}
    (folder / "client").write_text(client.name, encoding="ascii")
    print("libraries print too")  # noqa: T201
    with (folder / "trials").open("a+", encoding="ascii") as trials:
        trials.seek(0)
        done = len(trials.readlines())
        tell(_progress("approach", done))
        while done < TRIALS:
            _wait_until_allowed(spec, folder, done, cancelled)
            trials.write(f"{os.getpid()}\n")
            trials.flush()
            done += 1
            tell(_progress("record", done))
    if spec.participant == "clumsy" and not (folder.parent / "mended").exists():
        raise CalibrationError("the rig has tripped")
    if spec.participant == "broken":
        raise ZeroDivisionError("in the middle of it")
    if spec.participant == "fatal":
        os._exit(11)
    return _result(spec, folder)


def _wait_until_allowed(
    spec: CalibrationSpec, folder: Path, done: int, cancelled: Callable[[], bool]
) -> None:
    while int((folder.parent / "allowed").read_text("ascii")) <= done:
        if cancelled() and spec.participant != "deaf":
            (folder / "disarmed").touch()
            raise CancelledError("cancelled")
        time.sleep(0.005)


def _progress(phase: str, done: int) -> Progress:
    fields = {"phase": phase, "trials_done": done, "trials_planned": TRIALS}
    return Progress.model_validate(fields | {"trials_rejected": 0, "recorded_s": 4.0 * done})


def _result(spec: CalibrationSpec, folder: Path) -> CalibrationResult:
    model = Model(
        base=FirstOrderSpeedLaw(gain_n=0.4, cutoff_0_hz=400.0, slope_hz_per_mm_s=12.0),
        participant=spec.participant,
        provenance={
            "study_sha256": "ab" * 32,
            "code_version": "0.1.0",
            "settings": spec.protocol.model_dump(mode="json"),
            "seed": spec.seed,
        },
    )
    study = str(folder / "study.h5")
    return CalibrationResult(
        model=model, study=study, recorded_s=12.0, precision=0.03, reached=True
    )
