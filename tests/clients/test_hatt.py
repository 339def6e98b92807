"""Nodes of HaTT models become spectra with the power of the process, and say what they are."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import frictus
from frictus.errors import TextureError
from frictus.hatt import HattNode, components_of, read_hatt
from frictus.recordings import import_texture
from frictus_service.cli.app import app
from frictus_service.cli.options import Exit
from frictus_service.synthesis.components import components_of as layers_of

RATE_HZ = 10_000.0
RESONANCE_HZ = 250.0
POLE = 0.99 * np.exp(2j * np.pi * RESONANCE_HZ / RATE_HZ)
RESONANT = np.real(np.poly([POLE, np.conj(POLE)])).tolist()


def values(name: str, numbers: Sequence[float]) -> str:
    inner = "".join(f"<value>{number!r}</value>" for number in numbers)
    return f"<{name}>{inner}</{name}>"


def node_of(
    speed: float, force: float, ar: Sequence[float] = (1.0,), var: float = 1.0, more: str = ""
) -> str:
    return (
        f"<model><modNum>1</modNum>{values('ARcoeff', ar)}{values('ARlsf', ar[1:])}{more}"
        f"<var>{var}</var><speedMod>{speed}</speedMod><forceMod>{force}</forceMod></model>"
    )


def text_of(*nodes: str, head: str = "", rate: object = 10_000) -> str:
    return (
        f'<?xml version="1.0" encoding="utf-8"?>{head}<modelSet texture="0">'
        f"<material>Felt &amp; Foam</material><AccelUnits>m/s^2</AccelUnits>"
        f"<SpeedUnits>mm/s</SpeedUnits><SampleRate>{rate}</SampleRate><mu>0.4</mu>"
        f"{values('speedList', [1.0])}{''.join(nodes)}</modelSet>"
    )


def file_of(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "felt.xml"
    path.write_text(text, encoding="utf-8")
    return path


def test_white_noise_has_its_power_in_the_band() -> None:
    node = HattNode(100.0, 1.0, np.ones(1), np.ones(1), 4.0)
    hz, amplitude = components_of(node, RATE_HZ)
    assert np.sum(amplitude**2) / 2.0 == pytest.approx(4.0 * 980.0 / 5_000.0, rel=1e-6)
    assert hz.min() > 20.0
    assert hz.max() < 1_000.0


def test_a_first_order_process_has_the_power_of_its_closed_form() -> None:
    """The integral of 2/fs / |1 - a exp(-iw)|² is 2/pi (1 - a²)^-1 arctan((1+a)/(1-a) tan)."""
    a = 0.9
    node = HattNode(100.0, 1.0, np.array([1.0, -a]), np.ones(1), 1.0)
    _, amplitude = components_of(node, RATE_HZ)
    angle = np.pi * np.array([20.0, 1_000.0]) / RATE_HZ
    low, high = np.arctan((1.0 + a) / (1.0 - a) * np.tan(angle)) * 2.0 / (np.pi * (1.0 - a**2))
    assert np.sum(amplitude**2) / 2.0 == pytest.approx(high - low, rel=1e-4)
    moving = HattNode(100.0, 1.0, np.ones(1), 2.0 * np.array([1.0, 0.5]), 1.0)
    zero_hz = moving.power(np.zeros(1), RATE_HZ)[0]
    assert zero_hz == pytest.approx(2.0 / RATE_HZ * 9.0)


def test_the_nearest_node_becomes_a_texture_over_position(tmp_path: Path) -> None:
    path = file_of(tmp_path, text_of(node_of(50.0, 0.5), node_of(125.0, 1.5, RESONANT)))
    imported = import_texture(path, node=(120.0, 1.4), scale_n=0.01)
    texture = imported.texture
    assert isinstance(texture, frictus.Spectrum)
    strongest = max(texture.components, key=lambda one: one.amplitude_n)
    assert strongest.cycles_per_mm == pytest.approx(RESONANCE_HZ / 125.0, rel=0.03)
    again = import_texture(path, node=(125.0, 1.5), scale_n=0.02, angle_deg=30.0).texture
    assert isinstance(again, frictus.Spectrum)
    assert again.angle_deg == 30.0
    for angle_deg in (361.0, np.nan):
        with pytest.raises(TextureError, match="angle_deg"):
            import_texture(path, node=(125.0, 1.5), scale_n=0.02, angle_deg=angle_deg)
    for one, other in zip(texture.components, again.components, strict=True):
        assert other.amplitude_n == pytest.approx(2.0 * one.amplitude_n)
        assert other.phase_rad == one.phase_rad


def test_it_says_what_it_is_wherever_it_goes(tmp_path: Path) -> None:
    path = file_of(tmp_path, text_of(node_of(50.0, 0.5)))
    imported = import_texture(path, node=(50.0, 0.5), scale_n=0.01)
    (label,) = imported.notes
    for said in ("acceleration, not friction", "Felt & Foam", "50 mm/s", "0.5 N", "0.01 N per"):
        assert said in label
    scene = frictus.Scene(regions=[frictus.Region(texture=imported.texture)])
    sent = frictus.Scene.model_validate_json(scene.model_dump_json()).regions[0].texture
    assert isinstance(sent, frictus.Spectrum)
    assert sent.label == label
    (layer,) = layers_of(sent)
    assert label in layer.notes, "the rig's scene says it to whoever plays or records it"


def test_neither_node_nor_scale_are_assumed(tmp_path: Path) -> None:
    path = file_of(tmp_path, text_of(node_of(50.0, 0.5), node_of(100.0, 1.5)))
    with pytest.raises(TextureError, match=r"felt.xml: it has 2 nodes from 50 to 100 mm/s"):
        import_texture(path, scale_n=0.01)
    with pytest.raises(TextureError, match=r"not friction: say by scale_n"):
        import_texture(path, node=(50.0, 0.5))
    with pytest.raises(TextureError, match=r"give it none, and no part"):
        import_texture(path, 40.0, node=(50.0, 0.5), scale_n=0.01)
    with pytest.raises(TextureError, match=r"give a smaller scale_n"):
        import_texture(path, node=(50.0, 0.5), scale_n=1e9)
    wav = tmp_path / "linen.wav"
    with pytest.raises(TextureError, match=r"no HaTT model"):
        import_texture(wav, node=(50.0, 0.5))


BOMB = '<!DOCTYPE modelSet [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;">]>'


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "not an XML document"),
        (text_of(node_of(50.0, 0.5))[:-4], "not an XML document"),
        (text_of(node_of(50.0, 0.5), head=BOMB), "declares a document type"),
        (
            text_of(head='<!DOCTYPE m SYSTEM "file:///etc/passwd">'),
            "declares a document type",
        ),
        ("<other/>", "not a HaTT model"),
        (text_of(), "holds no <model>"),
        (text_of("<a>" * 50 + "</a>" * 50), "10 deep"),
        (text_of(node_of(50.0, 0.5, [2.0])), "must begin with 1"),
        (text_of(node_of(50.0, 0.5, [1.0, -1.1])), "not stable"),
        (text_of(node_of(50.0, 0.5, [1.0] * 300)), "more than 256 coefficients"),
        (text_of(node_of(50.0, 0.5, var=0.0)), "no finite power"),
        (text_of(node_of(50.0, 0.5, var=-1.0)), "variance -1; 0 to"),
        (text_of(node_of(0.0, 0.5)), "0 mm/s; 1 to 10000"),
        (text_of(node_of(float("nan"), 0.5)), "must be a number, not 'nan'"),
        (text_of(node_of(50.0, -0.5)), "-0.5 N; above 0"),
        (text_of("<model></model>"), "<var> is missing"),
        (text_of(node_of(50.0, 0.5), rate="fast"), "<SampleRate> must be a number"),
        (text_of(node_of(50.0, 0.5)).replace("mm/s", "m/s"), "only mm/s is read"),
    ],
)
def test_what_is_no_model_is_refused_in_words(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(TextureError, match=said):
        import_texture(file_of(tmp_path, text), node=(50.0, 0.5), scale_n=0.01)


def test_a_file_of_many_elements_is_refused_early() -> None:
    with pytest.raises(TextureError, match="more than 500000 elements"):
        read_hatt(text_of("<v/>" * 500_001))


def test_the_command_reads_node_and_scale(tmp_path: Path) -> None:
    path = file_of(tmp_path, text_of(node_of(50.0, 0.5)))
    odd = CliRunner().invoke(app, ["play", str(path), "--node", "50", "--scale", "0.01"])
    assert odd.exit_code == Exit.USAGE
    assert "such as 100:1.5" in odd.output
    missing = CliRunner().invoke(app, ["play", str(path), "--node", "50:0.5"])
    assert missing.exit_code == Exit.USAGE
    assert "not friction" in missing.output
