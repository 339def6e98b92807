"""Call an experiment from PsychoPy: its window shows and asks, frictus presents and keeps.

Without PsychoPy the same loop runs with a participant who answers by chance, so that it can be
tried anywhere.
"""

import importlib.util
import random
import sys
import time
from typing import Protocol

import frictus
from frictus.experiment import Design, Experiment, load_protocol

ROUTER = sys.argv[1] if len(sys.argv) > 1 else frictus.DEFAULT_ROUTER
TRIALS = int(sys.argv[2]) if len(sys.argv) > 2 else 6


class Display(Protocol):
    """What the loop below needs of whoever shows and asks."""

    def show(self, text: str) -> None:
        """Show a text."""

    def ask(self, text: str, keys: list[str]) -> tuple[str, float]:
        """Show a question; return the key, and the seconds until it was pressed."""
        ...


class Plain:
    """Answers by chance."""

    def show(self, text: str) -> None:
        """Print a text."""
        print(text)

    def ask(self, text: str, keys: list[str]) -> tuple[str, float]:
        """Print a question and answer it."""
        print(text)
        return random.choice(keys), 0.0


class PsychoPy:
    """A window of PsychoPy."""

    def __init__(self) -> None:
        from psychopy import core, event, visual

        self._event, self._clock = event, core.Clock()
        self._window = visual.Window(fullscr=True)
        self._text = visual.TextStim(self._window)

    def show(self, text: str) -> None:
        """Show a text from the next frame on."""
        self._text.text = text
        self._text.draw()
        self._window.flip()

    def ask(self, text: str, keys: list[str]) -> tuple[str, float]:
        """Show a question and wait for a key; Escape ends the program, and the rig disarms."""
        self.show(text)
        self._clock.reset()
        accepted = [*keys, "escape"]
        [(key, seconds)] = self._event.waitKeys(keyList=accepted, timeStamped=self._clock)
        if key == "escape":
            sys.exit("ended with Escape; the log has what was answered")
        return key, seconds


display: Display = PsychoPy() if importlib.util.find_spec("psychopy") else Plain()
protocol = load_protocol("amplitude-difference").model_copy(update={"design": Design()})
with frictus.connect(ROUTER) as client:
    log = f"psychopy-{time.strftime('%Y%m%dT%H%M%S')}.jsonl"
    with Experiment.of(client.rig("rig1"), protocol, log=log) as experiment:
        told = ""
        for _ in range(TRIALS):  # or: while (trial := experiment.next()) is not None
            trial = experiment.next()
            if trial is None:
                break
            display.show(f"{told}Move your finger.")
            intervals = experiment.present(trial)
            if intervals is None:  # the rig could not render it whole; another level is next
                continue
            response, seconds = display.ask(protocol.task.question, ["1", "2"])
            row = experiment.answer(trial, intervals, response, seconds)
            told = f"{row['level']:.2f} dB: {'right' if row['correct'] else 'wrong'}. "
        display.show(f"{told}That was all.")
