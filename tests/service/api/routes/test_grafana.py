"""The dashboard for Grafana asks for nothing that the service does not give."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from fastapi.testclient import TestClient
from tests.service.api.routes.test_metrics import samples

BOARD: Final = Path(__file__).parents[4] / "deploy" / "grafana" / "frictus.json"
METRIC: Final = re.compile(r"\bfrictus_\w+")
LABELLED: Final = re.compile(r"\b(frictus_\w+)\{([^}]*)\}")
FUNCTIONS: Final = {"increase", "rate", "sum", "topk", "histogram_quantile", "label_values"}


def queries() -> Iterator[str]:
    board = json.loads(BOARD.read_text(encoding="utf-8"))
    for panel in board["panels"]:
        yield from (target["expr"] for target in panel["targets"])
    for variable in board["templating"]["list"]:
        if variable["type"] == "query":
            yield variable["query"]


def test_every_metric_and_label_that_it_asks_for_is_there(api: TestClient, rig: Any) -> None:
    assert api.get("/v1/rigs").json(), rig.name  # so that requests have been counted
    given: dict[str, set[str]] = {}
    for name, labels in samples(api):
        given.setdefault(name, set()).update(label for label, _ in labels)
    asked = list(queries())
    assert len(asked) > 20
    for query in asked:
        named = METRIC.findall(query)
        assert named, query
        assert set(named) <= set(given), query
        for name, selected in LABELLED.findall(query):
            assert set(re.findall(r"(\w+)\s*=~?", selected)) <= given[name], query
        for grouped in re.findall(r"by \(([^)]*)\)", query):
            assert set(grouped.split(", ")) <= set().union(*(given[n] for n in named)), query
        called = set(re.findall(r"\b([a-z_]+)\s*\(", query)) - {"by"}
        assert called <= FUNCTIONS, query


def test_legends_name_labels_and_panels_do_not_overlap(api: TestClient, rig: Any) -> None:
    assert api.get("/v1/rigs").json(), rig.name
    labels = {label for _, found in samples(api) for label, _ in found}
    board = json.loads(BOARD.read_text(encoding="utf-8"))
    taken: set[tuple[int, int]] = set()
    for panel in board["panels"]:
        place = panel["gridPos"]
        cells = {
            (x, y)
            for x in range(place["x"], place["x"] + place["w"])
            for y in range(place["y"], place["y"] + place["h"])
        }
        assert not cells & taken, panel["title"]
        assert max(x for x, _ in cells) < 24
        taken |= cells
        for target in panel["targets"]:
            assert set(re.findall(r"\{\{(\w+)\}\}", target["legendFormat"])) <= labels
    assert len({panel["id"] for panel in board["panels"]}) == len(board["panels"])
