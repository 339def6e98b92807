"""What a lead costs is what was measured, and said to be of the simulated rig."""

import re
from pathlib import Path

import pytest

from frictus_service.cli.checks.service_checks import MEASURED, cost_of, lead_cost

DOCUMENT = Path(__file__).parents[3] / "docs" / "lead.md"
ROW = re.compile(r"^\| ([\d.]+) ms \| ([\d.]+) mm \| ([\d.]+) dB \|", re.MULTILINE)


def test_the_figures_are_those_of_the_document() -> None:
    rows = ROW.findall(DOCUMENT.read_text(encoding="utf-8"))
    assert [tuple(float(cell) for cell in row) for row in rows] == list(MEASURED), (
        "take them over from docs/lead.md, which bench/lead.py writes"
    )


def test_between_those_measured_it_is_linear_and_beyond_them_unknown() -> None:
    for row in MEASURED:
        assert lead_cost(row.lead_ms) == row
    one, other = MEASURED[-2:]
    middle = lead_cost(0.5 * (one.lead_ms + other.lead_ms))
    assert middle is not None
    assert middle.position_mm == pytest.approx(0.5 * (one.position_mm + other.position_mm))
    assert middle.bands_db == pytest.approx(0.5 * (one.bands_db + other.bands_db))
    for beyond in (0.0, MEASURED[0].lead_ms - 0.1, MEASURED[-1].lead_ms + 0.1, float("nan")):
        assert lead_cost(beyond) is None


def test_a_longer_lead_costs_more() -> None:
    leads, positions, _ = zip(*MEASURED, strict=True)
    assert list(leads) == sorted(leads)
    assert list(positions) == sorted(positions)
    assert MEASURED[-1].bands_db > MEASURED[0].bands_db


def test_the_cost_is_said_with_its_source() -> None:
    at_20, at_5 = lead_cost(20.0), lead_cost(5.0)
    assert at_20 is not None
    assert at_5 is not None
    said = cost_of(20.0, 5.0)
    assert f"{at_20.bands_db:.2f} dB and {at_20.position_mm:.2f} mm, with 5 ms" in said
    assert f"to {at_5.bands_db:.2f} and {at_5.position_mm:.2f}" in said
    for each in (said, cost_of(20.0, None)):
        assert "on the simulated rig, docs/lead.md" in each
    assert "with" not in cost_of(20.0, None)
    assert "from 2 to 30 ms" in cost_of(100.0, 9.0)
