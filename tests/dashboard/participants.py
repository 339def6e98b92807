"""A virtual participant before the page: feels the simulated rig's friction, and clicks."""

from collections.abc import Iterator
from contextlib import closing, contextmanager
from typing import Any, Final

import numpy as np
from playwright.sync_api import Page, expect

from frictus import Block, Rig
from frictus.experiment import SimulatedObserver, TwoAlternatives
from frictus.experiment.participant import FRICTION_ROW, felt_amplitude

TRIAL_MS: Final = 60_000
MARGIN_MS: Final = 450.0
"""The page is late by less: so much of the end of what it says was felt is left out."""
RECORD: Final = """() => {
  window.seen = [];
  const asked = document.querySelector("#view-participant .asked");
  const note = () => {
    const { kind, question } = asked.dataset;
    const title = asked.querySelector("h2").textContent;
    const shown = { kind, title, trial: question.split(" ")[1] };
    const last = window.seen.at(-1);
    if (["kind", "trial", "title"].every((name) => last?.[name] === shown[name])) return;
    window.seen.push({ ...shown, utcMs: performance.timeOrigin + performance.now() });
  };
  new MutationObserver(note).observe(asked, {
    attributes: true, childList: true, characterData: true, subtree: true,
  });
  note();
}"""
LAST_TRIAL: Final = """() => {
  const { trial, utcMs } = window.seen.findLast(({ kind }) => kind === "question");
  const interval = (number) => window.seen.findLast((each) =>
    each.trial === trial && each.kind === "interval" && each.title === number)?.utcMs ?? utcMs;
  return [interval("1"), interval("2"), utcMs];
}"""
"""When the page began to show each interval, and the question; at once what it left out."""


def asked(page: Page) -> Any:
    """What the participant is shown."""
    return page.locator("#view-participant .asked")


def expect_kind(page: Page, *kinds: str) -> str:
    """Wait until the page shows one of these, and return which."""
    found = page.wait_for_function(
        """(kinds) => {
          const kind = document.querySelector("#view-participant .asked")?.dataset.kind;
          return kinds.includes(kind) ? kind : null;
        }""",
        arg=list(kinds),
        timeout=TRIAL_MS,
    )
    return str(found.json_value())


@contextmanager
def answering(page: Page) -> Iterator[None]:
    """Wait for a question; within the block it is answered, and then another thing is shown."""
    expect_kind(page, "question")
    before = asked(page).get_attribute("data-question")
    yield
    page.wait_for_function(
        """(before) => {
          const { kind, question } =
            document.querySelector("#view-participant .asked").dataset;
          return kind !== "question" || question !== before;
        }""",
        arg=before,
        timeout=TRIAL_MS,
    )


class ClickingParticipant:
    """Answers a task of two intervals by what the finger felt while the page showed each.

    Knows what a person knows: what the page says, and the friction at the finger. On a machine
    too busy to show an interval in time it has felt nothing in it; `missed` names such answers.
    """

    def __init__(
        self, page: Page, rig: Rig, blocks: Any, observer: SimulatedObserver, rng: Any
    ) -> None:
        self.page, self.rig, self.blocks = page, rig, blocks
        self.observer, self.rng = observer, rng
        self.answers: list[str] = []
        self.missed: set[int] = set()
        page.evaluate(RECORD)

    def answer(self) -> str:
        """Answer the question that is shown; return the answer."""
        expect_kind(self.page, "question")
        felt = self._felt_n()
        answer = self.observer.answer(TwoAlternatives(), felt, self.rng)
        name = {"1": "First", "2": "Second"}[answer]
        with answering(self.page):
            asked(self.page).get_by_role("button", name=name).click()
        self.answers.append(answer)
        return answer

    def _felt_n(self) -> list[float]:
        first, second, question = self.page.evaluate(LAST_TRIAL)
        blocks = [block for block in self.blocks.drain() if isinstance(block, Block)]
        fit = self.rig.time()
        utc_ms = np.array([1e-6 * fit.utc_of(block.first_sample) for block in blocks])
        felt = []
        for begin, end in ((first, second), (second, question)):
            within = np.flatnonzero((utc_ms >= begin) & (utc_ms < end - MARGIN_MS))
            if within.size == 0:
                self.missed.add(len(self.answers))
                felt.append(0.0)
                continue
            friction = np.concatenate([blocks[i].data[FRICTION_ROW] for i in within])
            felt.append(felt_amplitude(friction.astype(float), blocks[0].sample_rate_hz))
        return felt


@contextmanager
def participant(
    page: Page, rig: Rig, observer: SimulatedObserver, rng: Any
) -> Iterator[ClickingParticipant]:
    """Put a virtual participant before a page of `#/participant/rig1`."""
    with closing(rig.blocks("truth", capacity=65_536)) as blocks:
        yield ClickingParticipant(page, rig, blocks, observer, rng)


def expect_waiting(page: Page) -> None:
    """Wait until the page says that the experiment will begin by itself."""
    expect(asked(page).get_by_role("heading")).to_have_text("Please wait")
