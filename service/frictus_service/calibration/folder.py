"""Where a calibration keeps what it has, so that a crash loses the trial under way at most.

``calibration.json`` says what was asked for; each finished trial is a study file of its own,
with the verdict on it; all of them together become ``study.h5``.
"""

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final, Self

from pydantic import ValidationError

from frictus.errors import explain
from frictus_service.calibration.job import CalibrationSpec
from frictus_service.calibration.plan import RecordedTrial
from frictus_service.durable import put_in_place, replace_file
from frictus_service.errors import Exclusion, FolderError, TrialError
from frictus_service.study.reader import StudyReader
from frictus_service.study.trial import StudyInfo, Trial
from frictus_service.study.writer import StudyWriter

SPEC: Final = "calibration.json"
STUDY: Final = "study.h5"
TRIALS: Final = "trials"
VERDICT: Final = "rejected"
"""Root attribute of a trial's file: why the trial may not be used, or empty."""


class CalibrationFolder:
    """The trials of one calibration.

    Parameters
    ----------
    path : Path
        Of the folder.
    spec : CalibrationSpec
        What the calibration was asked for.
    done : list of RecordedTrial
        In order.
    """

    def __init__(self, path: Path, spec: CalibrationSpec, done: list[RecordedTrial]) -> None:
        self.path = path
        self.spec = spec
        self._done = done

    @classmethod
    def open(cls, path: Path, spec: CalibrationSpec) -> Self:
        """Begin a calibration in a folder, or go on with the one that it holds.

        Only the number of the session may differ from what the folder says.

        Raises
        ------
        FolderError
            If the folder holds another calibration, or lacks a trial, or one is damaged.
        """
        (path / TRIALS).mkdir(parents=True, exist_ok=True)
        begun = read_spec(path)
        if begun is not None:
            _require_same(path, begun, spec)
        elif any((path / TRIALS).glob("*.h5")):
            raise FolderError(f"{path} holds trials but no {SPEC}; choose another folder")
        else:
            replace_file(path / SPEC, spec.model_dump_json(indent=1).encode())
        files = sorted((path / TRIALS).glob("*.h5"))
        for number, file in enumerate(files):  # the plan goes on by how many there were
            if file.stem != _id(spec, number):
                raise FolderError(
                    f"{path / TRIALS} lacks trial {_id(spec, number)}; put it back, or choose "
                    "another folder"
                )
        return cls(path, spec, [_done(file) for file in files])

    @property
    def done(self) -> tuple[RecordedTrial, ...]:
        """The finished trials, in order."""
        return tuple(self._done)

    @property
    def study(self) -> Path:
        """The study of all trials, once it is made."""
        return self.path / STUDY

    @property
    def next_id(self) -> str:
        """Id of the next trial; ids sort as the trials followed one another."""
        return _id(self.spec, len(self._done))

    def add(self, trial: Trial, info: StudyInfo, rejected: str) -> RecordedTrial:
        """Keep a trial; it is on the disk when this returns.

        Parameters
        ----------
        trial : Trial
            Its id is `next_id`.
        info : StudyInfo
            What holds for all trials.
        rejected : str
            Why it may not be used; empty where it may.

        Raises
        ------
        FolderError
            If something of the calibration is gone.
        NotWrittenError
            If the disk is full.
        """
        self._require_whole()
        file = self._file(trial.info.id)
        own = StudyInfo(
            info.rig,
            info.carrier_hz,
            info.screen_peak_v,
            info.mount,
            info.mount_json,
            {**info.extras, VERDICT: rejected},
        )
        with StudyWriter(file, own) as writer:
            writer.add(trial)
        done = _done(file)
        self._done.append(done)
        return done

    def trials(self, left_out: Callable[[Exclusion], None]) -> Iterator[Trial]:
        """Yield the finished trials in order.

        Parameters
        ----------
        left_out : callable
            Told of each that cannot be read: refused when it was recorded, or damaged since.
        """
        for done in self._done:
            with StudyReader(self._file(done.id)) as reader:
                try:
                    yield reader.read(done.id)
                except TrialError as error:
                    left_out(error.exclusion)

    def merge(self, info: StudyInfo) -> tuple[Exclusion, ...]:
        """Write `study`, of all trials, the rejected ones too; return what is not in it.

        Raises
        ------
        FolderError
            If something of the calibration is gone.
        NotWrittenError
            If the disk is full.
        """
        self._require_whole()
        left_out: list[Exclusion] = []
        unfinished = self.path / f"{STUDY}.new"
        unfinished.unlink(missing_ok=True)
        with StudyWriter(unfinished, info) as writer:
            for trial in self.trials(left_out.append):
                writer.add(trial)
        put_in_place(unfinished, self.study)
        return tuple(left_out)

    def _require_whole(self) -> None:
        """Raise where what is kept was deleted or moved: no participant slides for it."""
        kept = (self.path / SPEC, *(self._file(done.id) for done in self._done))
        if gone := [file for file in kept if not file.is_file()]:
            raise FolderError(
                f"{self.path} has lost {len(gone)} of {len(kept)} files since the calibration "
                f"began, such as {gone[0].relative_to(self.path)}: put them back and go on, or "
                "begin a new calibration"
            )

    def _file(self, trial_id: str) -> Path:
        return self.path / TRIALS / f"{trial_id}.h5"


def _id(spec: CalibrationSpec, number: int) -> str:
    return f"{spec.participant}-{number:04d}"


def _done(file: Path) -> RecordedTrial:
    with StudyReader(file) as reader:
        for lost in reader.excluded:
            raise FolderError(
                f"{file} is damaged: {lost.field} {lost.reason}; put a copy of it back, or "
                "choose another folder"
            )
        (info,) = reader.trials
        rejected = str(reader.info.extras.get(VERDICT, ""))
        return RecordedTrial(
            info.id,
            info.speed_mm_s,
            info.force_n,
            info.tones_hz,
            reader.n_samples(info.id) / info.sample_rate_hz,
            rejected,
        )


def read_spec(path: Path) -> CalibrationSpec | None:
    """Return what the calibration in a folder was asked to do; None if there is none.

    Raises
    ------
    FolderError
        If it cannot be read.
    """
    file = path / SPEC
    if not file.exists():
        return None
    try:
        return CalibrationSpec.model_validate_json(file.read_bytes())
    except (OSError, ValidationError) as error:
        told = explain(error) if isinstance(error, ValidationError) else error
        raise FolderError(f"{file} cannot be read: {told}; choose another folder") from error


def _require_same(path: Path, begun: CalibrationSpec, spec: CalibrationSpec) -> None:
    asked, held = (json.loads(one.model_dump_json()) for one in (spec, begun))
    differing = [name for name in asked if asked[name] != held[name] and name != "session"]
    if differing:
        raise FolderError(
            f"{path} holds a calibration with another {', '.join(differing)}; "
            "ask for the same again, or choose another folder"
        )
