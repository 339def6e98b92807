"""Simulated observers: they judge what a finger felt, with a difference threshold of their own.

Felt amplitude a in N rms enters as 10 log10(a² + a0²) dB with Gaussian noise on each interval,
so that equal ratios are equally discriminable well above the floor a0 (Weber's law), and
detection is the difference from the floor (Green and Swets 1966, Signal Detection Theory).
"""

import math
from dataclasses import dataclass
from statistics import NormalDist
from typing import Final

import numpy as np

from frictus.experiment.tasks import Adjustment, Magnitude, Task, TwoAlternatives, YesNo

JND_DB: Final = 1.21
"""Difference threshold of the amplitude of electrovibration, 75 % correct of two intervals."""
FLOOR_N: Final = 0.005


@dataclass(frozen=True, slots=True)
class SimulatedObserver:
    """An observer in the sense of signal detection theory.

    Attributes
    ----------
    jnd_db : float
        Difference that is told rightly in 75 % of pairs of intervals, dB, above 0.
    floor_n : float
        Amplitude of the internal noise, N rms, above 0.
    lapse : float
        Share of answers given at random, 0 to 1.
    exponent : float
        Of numbers given for magnitudes over felt amplitude.
    """

    jnd_db: float = JND_DB
    floor_n: float = FLOOR_N
    lapse: float = 0.02
    exponent: float = 0.7

    @property
    def noise_db(self) -> float:
        """Standard deviation of the noise on one interval: d' of a JND is that of 75 %."""
        return self.jnd_db / (math.sqrt(2.0) * NormalDist().inv_cdf(0.75))

    @property
    def detection_n(self) -> float:
        """Amplitude, N rms, that is told from smooth in 75 % of pairs of intervals."""
        return self.floor_n * math.sqrt(10.0 ** (self.jnd_db / 10.0) - 1.0)

    def felt_db(self, felt_n: float) -> float:
        """Return the internal magnitude, dB above the floor, 0 or more.

        Parameters
        ----------
        felt_n : float
            Amplitude of friction, N rms, 0 or above.
        """
        return 10.0 * math.log10(1.0 + (felt_n / self.floor_n) ** 2)

    def answer(self, task: Task, felt_n: list[float], rng: np.random.Generator) -> str:
        """Return an answer to what was felt.

        Parameters
        ----------
        task : Task
            What was asked.
        felt_n : list of float
            Amplitude of friction in each interval, N rms.
        rng : numpy.random.Generator
            Draws noise and lapses.
        """
        heights = [self.felt_db(each) for each in felt_n]
        noisy = [height + self.noise_db * float(rng.standard_normal()) for height in heights]
        lapses, guess = rng.random() < self.lapse, rng.random() < 0.5
        if isinstance(task, TwoAlternatives):
            first = guess if lapses else noisy[0] > noisy[1]
            return "1" if first else "2"
        if isinstance(task, YesNo):
            yes = guess if lapses else noisy[0] > 1.5 * self.noise_db
            return "y" if yes else "n"
        if isinstance(task, Magnitude):
            return repr(min(max(self._number(felt_n, noisy), task.low), task.high))
        difference = noisy[-1] - noisy[0]
        if isinstance(task, Adjustment):
            # Closer than half a step, a further step would be farther off.
            if abs(difference) < max(0.5 * task.step_db, self.noise_db):
                return "="
            return "-" if difference > 0.0 else "+"
        different = guess if lapses else abs(difference) > 2.0 * self.noise_db
        return "d" if different else "s"

    def _number(self, felt_n: list[float], noisy: list[float]) -> float:
        if len(noisy) == 2:  # how different: 0 to 100
            return 100.0 * (1.0 - math.exp(-abs(noisy[1] - noisy[0]) / 6.0))
        scatter_db = noisy[0] - self.felt_db(felt_n[0])
        felt_n_and_floor = math.hypot(felt_n[0], self.floor_n)
        return float(100.0 * felt_n_and_floor**self.exponent * 10.0 ** (scatter_db / 20.0))
