"""JSON as editors on Windows write it: behind the mark of UTF-8."""

import codecs
from pathlib import Path

from pydantic import TypeAdapter

from frictus.model import FirstOrderSpeedLaw, Model
from frictus.textures import Texture
from frictus_service.api.requests import parse_json
from frictus_service.cli import models
from frictus_service.daemon.rig import read_model
from frictus_service.discovery.problem.base_models import base_model
from frictus_service.library import TextureLibrary

MODEL = Model(
    base=FirstOrderSpeedLaw(gain_n=0.4, cutoff_0_hz=400.0, slope_hz_per_mm_s=14.0),
    provenance={"participant": "P01"},
)
TEXTURE = b'{"kind": "spectrum", "components": [{"amplitude_n": 0.1, "hz": 100.0}]}'


def test_models_and_textures_are_read_behind_a_mark(tmp_path: Path) -> None:
    marked = codecs.BOM_UTF8 + MODEL.to_json()
    path = tmp_path / "model.json"
    path.write_bytes(marked)
    assert read_model(path) == MODEL
    assert models.read_model(path) == MODEL
    assert base_model(str(path), "friction") == MODEL
    assert parse_json(TypeAdapter(Model), marked) == MODEL
    (tmp_path / "hum.json").write_bytes(codecs.BOM_UTF8 + TEXTURE)
    held = TextureLibrary(tmp_path).get("hum").texture
    assert held == TypeAdapter[Texture](Texture).validate_json(TEXTURE)
