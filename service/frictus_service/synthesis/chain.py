"""One block from finger to screen and back."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from frictus_hardware.arrays import FloatArray
from frictus_hardware.base import Backend, Exchange, TouchReport
from frictus_hardware.errors import HardwareError
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.screen import Screen
from frictus_service.synthesis.estimator import FingerEstimator, PredictedMotion
from frictus_service.synthesis.kernel import BlockMotion
from frictus_service.synthesis.renderer import Rendered, Renderer


class Follower(Protocol):
    """What the chain asks of a finger estimator."""

    @property
    def in_contact(self) -> bool:
        """Whether the finger touches."""
        ...

    def observe(self, report: TouchReport) -> None:
        """Take a report."""
        ...

    def sense(
        self,
        first_sample: int,
        force_n: FloatArray,
        accel_m_s2: FloatArray,
        saturated: bool = False,
    ) -> None:
        """Take the force and acceleration of a block."""
        ...

    def stale(self, sample: float) -> bool:
        """Return whether reports have stopped coming."""
        ...

    def predict(self, first_sample: int, n_samples: int) -> PredictedMotion:
        """Return the motion to render."""
        ...


@dataclass(frozen=True, slots=True)
class RenderedBlock:
    """What one block was.

    Attributes
    ----------
    exchange : Exchange
        What was applied and sensed.
    course : PredictedMotion
        The finger as it was predicted for the block that was handed over.
    rendered : Rendered
        What was played, and its flags.
    in_contact, stale : bool
        What the touch sensor says; nothing is rendered without contact or while it is stale.
    normal_force_n : float
        Mean over what was sensed.
    """

    exchange: Exchange
    course: PredictedMotion
    rendered: Rendered
    in_contact: bool
    stale: bool
    normal_force_n: float

    @property
    def motion(self) -> BlockMotion:
        """The finger's predicted motion."""
        return self.course.motion

    @property
    def quiet(self) -> bool:
        """Whether the output envelope has come down to zero."""
        return self.rendered.level == 0.0


class Chain:
    """A rig that renders.

    Parameters
    ----------
    backend : Backend
        Open. Arming it is the caller's part: output is asked for only where `step` allows it.
    estimator : Follower
        Predicts the motion that is rendered.
    renderer : Renderer
        Plays scenes and excitations.
    block_samples : int
        Samples of one block.
    """

    def __init__(
        self,
        backend: Backend,
        estimator: Follower,
        renderer: Renderer,
        block_samples: int,
    ) -> None:
        self.backend = backend
        self.estimator = estimator
        self.renderer = renderer
        self._block_samples = block_samples

    def step(self, allow: bool) -> RenderedBlock:
        """Render and exchange one block.

        Parameters
        ----------
        allow : bool
            Whether there may be output; the envelope ramps towards it.

        Raises
        ------
        HardwareError
            What the backend raises. Where the block was not taken, the next one goes on from
            the one before it.
        """
        play_sample = self.backend.next_play_sample
        course = self.estimator.predict(play_sample, self._block_samples)
        in_contact = self.estimator.in_contact
        stale = self.estimator.stale(play_sample - self.backend.info.lead_samples)
        rendered = self.renderer.render(
            play_sample, course, allow and in_contact and not stale, lifted=not in_contact
        )
        try:
            exchange = self.backend.exchange(rendered.voltage_v)
        except HardwareError:
            if self.backend.next_play_sample == play_sample:
                self.renderer.take_back()
            raise
        self.estimator.sense(
            exchange.first_sample,
            exchange.force_n,
            exchange.accel_m_s2,
            exchange.saturated_samples > 0,
        )
        for report in exchange.touches:
            self.estimator.observe(report)
        normal_n = exchange.force_n[:, 2]
        normal_force_n = float(np.add.reduce(normal_n) / normal_n.size)
        return RenderedBlock(exchange, course, rendered, in_contact, stale, normal_force_n)


def make_chain(
    backend: Backend, law: FrictionLaw, screen: Screen, block_samples: int = 100
) -> Chain:
    """Return a chain with the default estimator and a smooth scene."""
    rate_hz = backend.info.sample_rate_hz
    return Chain(
        backend,
        FingerEstimator(rate_hz),
        Renderer(law, screen, rate_hz, block_samples),
        block_samples,
    )
