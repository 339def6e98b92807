"""Recordings with a column map, written as one `study/1` file."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from frictus_hardware.physics.linear import TransferFunction
from frictus_service.data_import.column_map import ColumnMap
from frictus_service.data_import.mapped_study import ONE_PERSON, MappedStudy, is_nobody
from frictus_service.errors import Exclusion, StudyError
from frictus_service.study.trial import StudyInfo
from frictus_service.study.writer import StudyWriter


@dataclass(frozen=True, slots=True)
class Imported:
    """What came of an import.

    Attributes
    ----------
    trials : int
        Written.
    seconds : float
        Of all trials, and `recorded_s` of all recordings.
    recorded_s : float
        Of all recordings.
    excluded : tuple of Exclusion
        Strokes that make no trial.
    notes : tuple of str
        What was assumed or changed; sentences.
    """

    trials: int
    seconds: float
    recorded_s: float
    excluded: tuple[Exclusion, ...]
    notes: tuple[str, ...]


def import_recordings(
    recordings: Sequence[tuple[Path, ColumnMap]],
    out: Path,
    mount: TransferFunction | None,
    tell: Callable[[str], None] = lambda _: None,
) -> Imported:
    """Write recordings as a study; one is in memory at a time.

    Parameters
    ----------
    recordings : sequence of (Path, ColumnMap)
        Of the same screen and carrier.
    out : Path
        The study.
    mount : TransferFunction or None
        Under the screen.
    tell : callable
        Called with how far it is, for each trial.

    Raises
    ------
    StudyError
        If one cannot be used, or they are of different rigs; nothing is written then.
    """
    _check_same([column_map for _, column_map in recordings])
    first = recordings[0][1]
    info = StudyInfo(
        rig=first.rig,
        carrier_hz=first.carrier_hz,
        screen_peak_v=first.screen_peak_v,
        mount=mount,
        extras={"imported_from": ", ".join(path.name for path, _ in recordings)[:4000]},
    )
    orders: Counter[tuple[str, int]] = Counter()
    names: Counter[str] = Counter()
    excluded: list[Exclusion] = []
    notes: dict[str, None] = {}
    seconds = recorded_s = 0.0
    with StudyWriter(out, info) as writer:
        for path, column_map in recordings:
            study = MappedStudy(path, column_map)
            recorded_s += study.recorded_s
            excluded += study.excluded
            notes |= dict.fromkeys(str(study.info.extras["import_notes"]).split("; "))
            for asked in study.trials:
                tell(f"{path}: {sum(orders.values())} trials written")
                place = (asked.participant, asked.session)
                name = asked.id if not names[asked.id] else f"{asked.id}-{names[asked.id]}"
                names[asked.id] += 1
                trial = study.read(asked.id)
                told = replace(asked, id=name, order=orders[place])
                orders[place] += 1
                writer.add(replace(trial, info=told))
                seconds += len(trial.force_n) / asked.sample_rate_hz
    if len(recordings) > 1 and all(is_nobody(column_map) for _, column_map in recordings):
        notes[ONE_PERSON] = None
    notes.pop("", None)
    return Imported(sum(orders.values()), seconds, recorded_s, tuple(excluded), tuple(notes))


def _check_same(maps: Sequence[ColumnMap]) -> None:
    for key in ("rig", "carrier_hz", "screen_peak_v"):
        values = {getattr(each, key) for each in maps}
        if len(values) > 1:
            raise StudyError(
                f"the files differ in {key}: {', '.join(map(str, sorted(values)))}; a study "
                "has one; import them apart"
            )
