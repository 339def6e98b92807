"""`frictus study show --friction`: friction coefficient, texture and stick-slip of slides."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from frictus_service.cli.options import wants_lines, write_line

if TYPE_CHECKING:
    from frictus_service.data_import.friction.coefficient import StudentInterval
    from frictus_service.data_import.friction.report import FrictionReport
    from frictus_service.data_import.friction.slides import Slide


def show_friction(files: list[Path], map_file: Path | None, as_json: bool) -> None:
    """Print what slides without a drive show, of all files together.

    Parameters
    ----------
    files : list of Path
        Studies, or recordings with a column map.
    map_file : Path or None
        Of all recordings; None: the map beside each.
    as_json : bool
        One object as one line, instead of sentences.
    """
    from frictus_service.data_import.friction.report import report_friction

    slides = [slide for file in files for slide in _slides(file, map_file)]
    found = report_friction(slides)
    if wants_lines(as_json):
        write_line(files=[str(file) for file in files], **found.fields())
        return
    for line in _lines(found):
        sys.stdout.write(f"{line}\n")


def _slides(file: Path, map_file: Path | None) -> "list[Slide]":
    from frictus_service.data_import.column_map import load_map, map_beside
    from frictus_service.data_import.formats.read import read_columns
    from frictus_service.data_import.friction.slides import slides_of_recording, slides_of_study
    from frictus_service.data_import.mapped_study import IMPORTER
    from frictus_service.data_import.recording_names import speed_in
    from frictus_service.data_import.recordings_in_file import mapped_recordings
    from frictus_service.study.importers import open_study

    if map_file is None and not IMPORTER.recognises(file):
        with open_study(file) as study:
            return list(slides_of_study(study))
    column_map = load_map(map_file or map_beside(file))
    moved = {"position_x", "velocity_x"} & set(column_map.channels)
    if not moved and column_map.stage_speed_mm_s is None:
        # One map for files at several speeds.
        named = {"stage_speed_mm_s": speed_in(file.stem)}
        column_map = column_map.model_copy(update=named)
    recordings, excluded = mapped_recordings(read_columns(file), column_map, file)
    for one in excluded:
        sys.stderr.write(f"left out: {one.trial}, {one.field}: {one.reason}\n")
    return [
        slide
        for recording in recordings
        for slide in slides_of_recording(recording, column_map.screen_peak_v)
    ]


def _lines(found: "FrictionReport") -> list[str]:
    lines = [f"{found.slides} slides, {found.driven} of them driven and left out"]
    if (friction := found.coefficient) is not None:
        lines.append(
            f"friction coefficient {_shown(friction.coefficient)} at "
            f"{friction.speed_mm_s:.3g} mm/s and {friction.load_n:.3g} N "
            f"({friction.slides} slides)"
        )
        lines.append(f"exponent of the speed {_shown(friction.speed_exponent)}")
        lines.append(f"exponent of the load {_shown(friction.load_exponent)} (1: Amontons)")
    if (texture := found.texture) is not None:
        lines.append(
            f"{texture.force} force varies by {_shown(texture.rms)} rms; "
            f"{texture.lines} of {texture.slides} slides have a line: {texture.origin}"
        )
        if texture.slope is not None:
            lines.append(f"slope of log frequency over log speed {_shown(texture.slope)}")
        if texture.period_mm is not None:
            lines.append(f"period {_shown(texture.period_mm)} mm")
        if texture.frequency_hz is not None:
            lines.append(f"at {_shown(texture.frequency_hz)} Hz at every speed")
    for each in found.spectra:
        levels = zip(each.centre_hz, each.rms, strict=True)
        loudest = sorted(levels, key=lambda level: -level[1])[:3]
        told = ", ".join(f"{rms:.3g} at {hz:.3g} Hz" for hz, rms in loudest)
        lines.append(
            f"{each.speed_mm_s:g} mm/s, {each.slides} slides: mean {_shown(each.mean)}; "
            f"strongest third octaves, rms: {told} (all of them: --json)"
        )
    if (slips := found.stick_slip) is not None:
        share = "" if slips.drop_share is None else f", each {slips.drop_share:.0%} of friction"
        rate = slips.slips_per_s
        told = "" if rate is None else f", {_shown(rate)} slips per second{share}"
        lines.append(
            f"stick-slip: {slips.verdict}; skewness of the rate {_shown(slips.skewness)}{told}"
        )
    return [*lines, *(f"- {note}" for note in found.notes)]


def _shown(value: "StudentInterval | None") -> str:
    if value is None:
        return "-"
    return f"{value.value:.3g} [{value.low:.3g}, {value.high:.3g}]"
