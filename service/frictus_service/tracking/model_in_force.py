"""The model that a rig renders by, as the tracker compares with it."""

from dataclasses import dataclass

import numpy as np

from frictus.messages import LawValues
from frictus.model import FirstOrderSpeedLaw, Model
from frictus_hardware.arrays import FloatArray
from frictus_service.calibration import coordinates
from frictus_service.tracking.adaptation import law_values


@dataclass(frozen=True, slots=True)
class ModelInForce:
    """The model that the rig renders by.

    Attributes
    ----------
    etag : str
        As the rig publishes it.
    at : ndarray, shape (4,), or None
        In `calibration.coordinates`; None where it has no first-order law of friction.
    values : LawValues or None
        The same for people.
    effects : frozenset of str
        That it has beyond the law: they are no news.
    """

    etag: str
    at: FloatArray | None
    values: LawValues | None = None
    effects: frozenset[str] = frozenset()

    @classmethod
    def of(cls, etag: str, model: Model) -> "ModelInForce":
        """Return a model in the coordinates of the estimate.

        Parameters
        ----------
        etag : str
            As the rig publishes it.
        model : Model
            Of friction.
        """
        law = model.base
        if not isinstance(law, FirstOrderSpeedLaw):
            return cls(etag, None)
        ends = np.array([coordinates.LOW_MM_S, coordinates.HIGH_MM_S])
        if np.any(law.cutoff_0_hz + law.slope_hz_per_mm_s * ends <= 0.0):
            return cls(etag, None)
        return cls(
            etag,
            coordinates.from_law(
                law.gain_n, law.cutoff_0_hz, law.slope_hz_per_mm_s, model.skew_s
            ),
            law_values(model),
            frozenset(effect.id for effect in model.effects),
        )

    def delay_off_s(self, other: "ModelInForce") -> float:
        """Return by how much the delay that a model tells is off another's, s.

        Parameters
        ----------
        other : ModelInForce
            Infinitely far where either tells none.
        """
        if self.at is None or other.at is None:
            return np.inf
        return float(self.at[3] - other.at[3])
