"""The shape of what `frictus bench` says; how fast this machine is, no test judges."""

import io
import json
import math

import pytest
from rich.console import Console

from frictus_laboratory.benchmarks import latency, report, throughput
from frictus_laboratory.benchmarks.figure import Figure, Target, interleaved, skipped, spread
from frictus_laboratory.benchmarks.report import bench, show

FIELDS = {"name", "unit", "value", "beside", "ratio", "target", "met", "remark"}
FIGURES = [
    Figure("fast", "ms", {"p50": 1.0}, {"bare": 2.0}, 0.5, Target("ratio", "at most", 0.9)),
    Figure("slow", "ms", {"zero": 120.0}, target=Target("zero", "at most", 100.0)),
    skipped("absent", "ms", "no signals here"),
]


@pytest.mark.parametrize(
    ("measured", "sense", "met"),
    [
        (0.9, "at least", True),
        (0.89, "at least", False),
        (1.5, "at most", True),
        (1.51, "at most", False),
        (math.nan, "at most", False),
        (math.nan, "at least", False),
    ],
)
def test_target(measured: float, sense: str, met: bool) -> None:
    target = Target("ratio", sense, 0.9 if sense == "at least" else 1.5)  # type: ignore[arg-type]
    assert Figure("x", "ms", {}, ratio=measured, target=target).met is met


def test_met_is_unknown_without_target_or_measurement() -> None:
    assert Figure("x", "ms", {"p50": 1.0}).met is None
    assert Figure("x", "ms", {}, target=Target("ratio", "at most", 1.0)).met is None
    assert skipped("x", "ms", "why").met is None


def test_contenders_take_turns() -> None:
    order: list[str] = []

    def contender(name: str, results: list[float]) -> float:
        order.append(name)
        return results.pop()

    first, second = [1.0, 50.0, 2.0], [4.0, 3.0, 5.0]
    medians = interleaved(3, lambda: contender("a", first), lambda: contender("b", second))
    assert medians == [2.0, 4.0]
    assert order == ["a", "b"] * 3


def test_spread() -> None:
    assert spread([3.0] * 10, worst=True) == {"p50": 3.0, "p99": 3.0, "max": 3.0}


@pytest.fixture
def measured(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(report, "MEASUREMENTS", {"all": lambda: FIGURES})


@pytest.mark.usefixtures("measured")
def test_json_is_one_object(capsys: pytest.CaptureFixture[str]) -> None:
    bench(as_json=True)
    captured = capsys.readouterr()
    (line,) = captured.out.splitlines()
    found = json.loads(line)
    assert found["schema"] == "bench/1"
    assert {"version", "seconds", "machine"} < set(found)
    assert [set(figure) for figure in found["figures"]] == [FIELDS] * len(FIGURES)
    assert [figure["met"] for figure in found["figures"]] == [True, False, None]
    assert "measuring 1 of 1: all" in captured.err


@pytest.mark.usefixtures("measured")
def test_table_names_every_figure() -> None:
    text = io.StringIO()
    show(report.measure_all(lambda _line: None), Console(file=text, width=160))
    for words in ("fast", "at most 100", "no signals here"):
        assert words in text.getvalue()


def test_throughput_with_few_blocks() -> None:
    throughput_figure, turn = throughput.measure(turns=10, repeats=1)
    assert throughput_figure.name == "block_throughput"
    assert throughput_figure.met is not None
    assert turn.value["publisher"] > 0.0


@pytest.mark.long
def test_updates_are_seen_at_the_dac() -> None:
    rendered, played = latency.measure_update(updates=2)
    assert played.value["p50"] > rendered.value["p50"]
    assert played.beside["p50"] > rendered.beside["p50"] > 5.0
