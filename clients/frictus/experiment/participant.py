"""Who answers an experiment."""

from typing import Protocol

from frictus.experiment.presentation import PresentedInterval
from frictus.experiment.schedule import Trial


class Participant(Protocol):
    """Whoever answers: at a terminal, in PsychoPy, or simulated."""

    def rest(self, trial: Trial) -> None:
        """Return once the participant wants to go on after a break.

        Parameters
        ----------
        trial : Trial
            What comes next.
        """
        ...

    def begin(self, trial: Trial, interval: int) -> None:
        """Learn that an interval begins.

        Parameters
        ----------
        trial : Trial
            Under way.
        interval : int
            From 1.
        """
        ...

    def ask(self, trial: Trial, intervals: list[PresentedInterval]) -> str:
        """Return the answer.

        Parameters
        ----------
        trial : Trial
            Under way.
        intervals : list of PresentedInterval
            What was presented.
        """
        ...

    def learn(self, trial: Trial, right: bool) -> None:
        """Learn whether the answer was right, where the trial gives feedback.

        Parameters
        ----------
        trial : Trial
            Answered.
        right : bool
            Whether it was.
        """
        ...
