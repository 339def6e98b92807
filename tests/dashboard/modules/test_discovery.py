"""What the page says of a discovery, as the service documents it."""

import numpy as np
import pytest
from playwright.sync_api import Page
from tests.service.discovery.found import discovery

from frictus_service.discovery.document import OneRecording, ParameterEstimate, RankedModel

pytestmark = pytest.mark.browser


@pytest.mark.parametrize("beyond", [True, False])
def test_one_recording_is_ranked_though_nothing_is_tested(
    page: Page, rng: np.random.Generator, beyond: bool
) -> None:
    delay = ParameterEstimate(value=0.25, ci95=(0.24, 0.26), unit="ms")
    base = RankedModel(
        causes=(), parameters={}, heldout_loglik=0.0, explained=0.0, standard_error=1.0, aic=0.0
    )
    delayed = base.model_copy(
        update={
            "causes": ("channel_delay",),
            "parameters": {"channel_delay": {"delay_ms": delay}},
            "explained": 0.93,
            "aic": -812.4,
        }
    )
    one = OneRecording(
        statement="In this recording only, a delay of 0.25 ms explains it.",
        beyond_threshold=beyond,
        margin=12.0,
        threshold="2 nats",
        models=(delayed, base),
        searched=41,
        silent=("stick_slip",),
        participant="P01",
        seconds=10.0,
        windows=180,
        folds=4,
        window_s=0.1,
        apart_s=0.05,
        correlation_s=0.001,
    )
    found = discovery(rng).model_copy(
        update={"verdict": None, "causes": (), "gain": None, "one_recording": one}
    )
    headline, text = page.evaluate(
        """async ([found, sentence]) => {
          const { report } = await import("/discovery/report.js");
          const shown = document.createElement("div");
          shown.append(...report(found, sentence));
          return [shown.querySelector("[data-verdict]").textContent, shown.textContent];
        }""",
        [found.model_dump(mode="json", by_alias=True), one.statement],
    )
    said = "causes are ranked" if beyond else "nothing beyond chance"
    assert headline == f"One recording: {said}"
    assert "channel delay (delay_ms 0.25 ms (95 %: 0.24 to 0.26))93 %-812" in text
    assert "base model alone" in text
    assert "41 candidates tried; it holds for this recording only" in text
    assert "shows nothing of stick slip." in text
