"""Who answers an experiment; a simulated observer feels what a simulated rig renders."""

from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from frictus.block import Block
from frictus.errors import ArgumentError
from frictus.experiment.presentation import PresentedInterval
from frictus.experiment.procedures.orders import generator
from frictus.experiment.procedures.schedule import ScheduledTrial
from frictus.experiment.psychometrics.observers import SimulatedObserver
from frictus.experiment.tasks import Task
from frictus.rig import Rig
from frictus.textures import BAND_HZ

SPEED_ROWS: Final = slice(2, 4)
FRICTION_ROW: Final = 4
"""Of the stream `truth`."""
CAPACITY: Final = 65_536
LEAST_S: Final = 0.04


class Participant(Protocol):
    """Whoever answers: at a terminal, in PsychoPy, or simulated."""

    def rest(self, trial: ScheduledTrial) -> None:
        """Return once the participant wants to go on after a break.

        Parameters
        ----------
        trial : ScheduledTrial
            What comes next.
        """
        ...

    def begin(self, trial: ScheduledTrial, interval: int) -> None:
        """Learn that an interval begins.

        Parameters
        ----------
        trial : ScheduledTrial
            Under way.
        interval : int
            From 1.
        """
        ...

    def ask(self, trial: ScheduledTrial, intervals: list[PresentedInterval]) -> str:
        """Return the answer.

        Parameters
        ----------
        trial : ScheduledTrial
            Under way.
        intervals : list of PresentedInterval
            What was presented.
        """
        ...

    def learn(self, trial: ScheduledTrial, right: bool) -> None:
        """Learn whether the answer was right, where the trial gives feedback.

        Parameters
        ----------
        trial : ScheduledTrial
            Answered.
        right : bool
            Whether it was.
        """
        ...


def felt_amplitude(friction_n: NDArray[np.floating], sample_rate_hz: float) -> float:
    """Return the root mean square of friction between 20 and 1000 Hz, N.

    Parameters
    ----------
    friction_n : ndarray, shape (n_samples,)
        N.
    sample_rate_hz : float
        Above 2000 Hz.
    """
    window = np.hanning(friction_n.size)
    power = np.abs(np.fft.rfft(window * (friction_n - np.mean(friction_n)))) ** 2
    hz = np.fft.rfftfreq(friction_n.size, 1.0 / sample_rate_hz)
    within = (hz >= BAND_HZ[0]) & (hz <= BAND_HZ[1])
    # Parseval, for one-sided power and the window's own power.
    return float(np.sqrt(2.0 * np.sum(power[within]) / (friction_n.size * np.sum(window**2))))


class VirtualParticipant:
    """Answers by what the finger of a simulated rig feels; close it at the end.

    Parameters
    ----------
    rig : Rig
        A rig that publishes the stream `truth`.
    task : Task
        What is asked.
    observer : SimulatedObserver
        Thresholds and noise.
    seed : int
        Of its noise, 0 or above; each trial draws anew from it.

    Attributes
    ----------
    felt_n : list of float
        Amplitudes of friction of the last trial's intervals, N rms.
    """

    def __init__(self, rig: Rig, task: Task, observer: SimulatedObserver, seed: int) -> None:
        if not rig.status().simulated:
            raise ArgumentError(
                f"rig {rig.name} is not simulated: what its finger feels is not known, so a "
                "simulated observer cannot answer"
            )
        self._task, self._observer, self._seed = task, observer, seed
        self._asked = 0
        self._blocks = rig.blocks("truth", capacity=CAPACITY)
        self.felt_n: list[float] = []

    def rest(self, trial: ScheduledTrial) -> None:
        """Need no break.

        Parameters
        ----------
        trial : ScheduledTrial
            What comes next.
        """

    def begin(self, trial: ScheduledTrial, interval: int) -> None:
        """Forget what was felt before the first interval.

        Parameters
        ----------
        trial : ScheduledTrial
            Under way.
        interval : int
            From 1.
        """
        if interval == 1:
            self._blocks.drain()

    def ask(self, trial: ScheduledTrial, intervals: list[PresentedInterval]) -> str:
        """Answer by the friction of each interval.

        Parameters
        ----------
        trial : ScheduledTrial
            Under way.
        intervals : list of PresentedInterval
            What was presented.
        """
        blocks = [block for block in self._blocks.drain() if isinstance(block, Block)]
        self.felt_n = [_felt(blocks, each) for each in intervals]
        self._asked += 1
        rng = generator(self._seed, "observer", trial.number, self._asked)
        return self._observer.answer(self._task, self.felt_n, rng)

    def learn(self, trial: ScheduledTrial, right: bool) -> None:
        """Learn nothing.

        Parameters
        ----------
        trial : ScheduledTrial
            Answered.
        right : bool
            Whether the answer was right.
        """

    def close(self) -> None:
        """Stop receiving. Closing twice is harmless."""
        self._blocks.close()


def _felt(blocks: list[Block], interval: PresentedInterval) -> float:
    """Return the amplitude felt in the middle half of an interval, its fades left out."""
    length = interval.last_sample - interval.first_sample
    begin, end = interval.first_sample + length // 4, interval.last_sample - length // 4
    within = [
        block
        for block in blocks
        if block.run == interval.run and begin <= block.first_sample < end
    ]
    if not within:
        return 0.0
    # Where strokes turn there is little to feel: it is judged while the finger moves.
    speed = np.array([np.mean(np.hypot(*block.data[SPEED_ROWS])) for block in within])
    moving = speed >= 0.5 * np.median(speed)
    within = [block for block, moves in zip(within, moving, strict=True) if moves]
    friction = np.concatenate([block.data[FRICTION_ROW] for block in within]).astype(float)
    rate_hz = within[0].sample_rate_hz
    if friction.size < LEAST_S * rate_hz or not np.all(np.isfinite(friction)):
        return 0.0
    return felt_amplitude(friction, rate_hz)
