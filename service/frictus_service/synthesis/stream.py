"""Streamed textures: bias and gain are fixed when a stream opens and hold until it ends."""

from dataclasses import dataclass

import numpy as np

from frictus.errors import TextureError
from frictus.messages import Applied
from frictus.stream import StreamFrame
from frictus_hardware.physics.friction import FrictionLaw, cutoff_hz
from frictus_service.synthesis.compensation import Inverse, Invertible, as_inverse
from frictus_service.synthesis.components import periodic
from frictus_service.synthesis.layers import single_table
from frictus_service.synthesis.scene import CompiledScene, fit
from frictus_service.synthesis.tables import TOP_HZ, build_table


@dataclass(frozen=True, slots=True)
class StreamBudget:
    """What the updates of one stream may ask of the drive.

    A texture that is limited to the band and never exceeds the declared peak P asks for at
    most ``P sqrt(1 + (f_top / f_c)^2) / g`` of drive (Bernstein's inequality), whatever its
    shape, so that the bias and the gain need not change with the updates.

    Attributes
    ----------
    peak_n : float
        Declared peak of every update, its mean taken off, N.
    inverse : Inverse
        What is undone.
    quiet : CompiledScene
        What is felt before the first update and when updates stop: the bias alone.
    """

    peak_n: float
    inverse: Inverse
    quiet: CompiledScene

    @classmethod
    def open(cls, peak_n: float, law: Invertible) -> "StreamBudget":
        """Return the budget of a stream with the declared peak, N."""
        nothing = single_table(
            build_table(periodic(np.array([0.0, 1e-12]), 1.0, True, 0.0), (0.0, 1.0)), True, 0.0
        )
        inverse = as_inverse(law)
        reach = _reach(peak_n, inverse.bounding)
        return cls(peak_n, inverse, fit(nothing, -reach, reach, inverse, [], "stream"))

    @property
    def applied(self) -> Applied:
        """Gain and bias of every update."""
        return self.quiet.applied

    def compile(self, frame: StreamFrame) -> CompiledScene:
        """Compile one update; constant friction is silence.

        Raises
        ------
        TextureError
            If the update exceeds the declared peak or cannot be represented.
        """
        if np.all(frame.friction_n == frame.friction_n[0]):
            return self.quiet
        components = periodic(
            frame.friction_n.astype(float), frame.period, frame.spatial, frame.angle_deg
        )
        table = build_table(components, (0.0, frame.period))
        peak = max(float(np.abs(rows).max()) for rows in table.octaves)
        if not peak <= self.peak_n * (1.0 + 1e-3):
            raise TextureError(
                f"friction reaches {peak:.4g} N between its samples, "
                f"the stream declared {self.peak_n:.4g} N; open it with a larger peak"
            )
        arrays = single_table(table, frame.spatial, frame.angle_deg)
        reach = _reach(self.peak_n, self.inverse.bounding)
        return fit(arrays, -reach, reach, self.inverse, [], "stream")


def _reach(peak_n: float, law: FrictionLaw) -> float:
    slowest = float(np.min(cutoff_hz(law, np.array(law.speed_range_mm_s))))
    return peak_n * float(np.sqrt(1.0 + (TOP_HZ / slowest) ** 2)) / law.gain_n
