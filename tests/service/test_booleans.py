"""`true` is no number: what people write in files is refused where it stands for one."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from frictus.experiment import parse_protocol, ready_protocols
from frictus.experiment.protocol import Design
from frictus.experiment.tasks import Magnitude
from frictus.recordings import load_texture
from frictus_service.cli.models import read_model
from frictus_service.cli.streams.play import scene_of
from frictus_service.daemon.rig import read_model as read_rig_model
from frictus_service.data_import.column_map import load_map
from frictus_service.discovery.plan.documents import read_design
from frictus_service.discovery.problem.base_models import base_model
from frictus_service.errors import StudyError
from frictus_service.library import TextureLibrary

MODEL = """{"schema": "model/1", "base": {"law": "first_order_speed", "gain_n": true,
 "cutoff_0_hz": 80.0, "slope_hz_per_mm_s": 1.0}}"""
TEXTURE = '{"kind": "spectrum", "components": [{"amplitude_n": true, "hz": 100}]}'
DESIGN = """{"participants": true, "tones_hz": [40], "speeds_mm_s": [40], "forces_n": [0.4]}"""


def _library(path: Path) -> object:
    return TextureLibrary(path.parent).get(path.stem)


def _scene(path: Path) -> object:
    return scene_of(str(path), path.parent)


def _base(path: Path) -> object:
    return base_model(str(path), "friction")


@pytest.mark.parametrize(
    ("read", "name", "text", "where"),
    [
        (load_texture, "t.json", TEXTURE, "components.0.amplitude_n"),
        (_library, "t.json", TEXTURE, "components.0.amplitude_n"),
        (_scene, "s.json", f'{{"regions": [{{"texture": {TEXTURE}}}]}}', "amplitude_n"),
        (read_model, "m.json", MODEL, "gain_n"),
        (read_rig_model, "m.json", MODEL, "gain_n"),
        (_base, "m.json", MODEL, "gain_n"),
        (read_design, "d.json", DESIGN, "participants"),
        (load_map, "m.toml", "rate_hz = true\n[channels]\n", "rate_hz"),
    ],
)
def test_a_boolean_is_no_number(
    read: Callable[[Any], object], name: str, text: str, where: str, tmp_path: Path
) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(Exception, match=rf"{where}[\s\S]*should be a valid (number|integer)"):
        read(tmp_path / name)


def test_a_boolean_is_no_sign(tmp_path: Path) -> None:
    file = tmp_path / "m.toml"
    file.write_text('[channels.force_x]\ncolumn = "Fx"\nunit = "N"\nsign = true\n')
    with pytest.raises(StudyError, match=r"force_x\.sign: Input should be a valid number"):
        load_map(file)


def test_a_boolean_is_no_literal_number_of_a_protocol() -> None:
    with pytest.raises(ValueError, match=r"intervals[\s\S]*should be a valid number"):
        Magnitude.model_validate_json('{"intervals": true}', strict=True)
    with pytest.raises(ValueError, match=r"catch_every[\s\S]*should be a valid number"):
        Design.model_validate_json('{"catch_every": false}', strict=True)


@pytest.mark.parametrize("entry", ["trials", "interval_s", "practice", "break_every", "low"])
def test_a_boolean_is_no_number_of_a_protocol(entry: str) -> None:
    text = ready_protocols()["detection"].read_text()
    text = re.sub(rf"\b{entry} = [\d.]+", f"{entry} = true", text)
    with pytest.raises(ValueError, match=rf"{entry}: Input should be a valid .* \(got True\)"):
        parse_protocol(text.encode(), "detection.toml")
