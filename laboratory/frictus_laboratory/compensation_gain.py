"""What it gains to undo an effect: the rendering error without and with it in the model."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from frictus.textures import Texture
from frictus_hardware.physics.effects import extended
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.screen import Screen
from frictus_hardware.physics.simulator import Simulator
from frictus_service.fidelity.measure import (
    feel,
    full_gain,
    steady_segments,
    target_along,
    waveform_error,
)
from frictus_service.fidelity.path import Path
from frictus_service.fidelity.preview import band_power, error_db, rms_db
from frictus_service.synthesis.compensability import inverse_of
from frictus_service.synthesis.compensation import Inverse, Invertible

Effects = Sequence[tuple[str, Mapping[str, float]]]

FRICTION_COEFFICIENT = 0.5
"""Of the finger without drive; what is compared does not depend on it."""


@dataclass(frozen=True, slots=True)
class Stroke:
    """A path at one speed, and when in its session it is made.

    Attributes
    ----------
    path : Path
        Of the finger.
    speed_mm_s : float
        Between the turns.
    minutes : float
        Since the session began.
    """

    path: Path
    speed_mm_s: float
    minutes: float = 0.0


@dataclass(frozen=True, slots=True)
class RenderingError:
    """How far what is felt is from what was asked for.

    Attributes
    ----------
    rms_db : float
        Level error in third octaves, over strokes, directions and thirds of the way.
    waveform : float
        Rms error of the waveform as a share of the target's, over strokes.
    clipped_share : float
        Share of the samples whose drive did not fit.
    """

    rms_db: float
    waveform: float
    clipped_share: float


@dataclass(frozen=True, slots=True)
class ExtensionGain:
    """The error before and after the effects came into the model, and the strength it costs.

    Attributes
    ----------
    before, after : RenderingError
        Without and with the effects in the model.
    applied_share : float
        Largest gain of the texture with the effects over that without.
    """

    before: RenderingError
    after: RenderingError
    applied_share: float


def gain_of(
    effects: Effects,
    texture: Texture,
    strokes: Sequence[Stroke],
    law: FrictionLaw,
    screen: Screen,
) -> ExtensionGain:
    """Feel a texture on a twin that has the effects, without and with them undone.

    Parameters
    ----------
    effects : sequence of (id, parameters)
        What the finger has, and what the extended model says.
    texture : Texture
        No map.
    strokes : sequence of Stroke
        Along which it is felt.
    law : FrictionLaw
        Of the finger and of both models.
    screen : Screen
        Its peak voltage, carrier and size.
    """
    simulator = extended(Simulator(law=law), effects)
    inverse = inverse_of(law, effects)
    rate_hz = strokes[0].path.sample_rate_hz
    plain = full_gain(texture, law, screen, rate_hz).applied.gain
    applied = full_gain(texture, inverse, screen, rate_hz).applied.gain
    before, after = (
        _felt(undone, inverse, simulator, texture, strokes, screen) for undone in (law, inverse)
    )
    return ExtensionGain(before, after, applied / plain)


def _felt(
    undone: Invertible,
    fitting: Inverse,
    simulator: Simulator,
    texture: Texture,
    strokes: Sequence[Stroke],
    screen: Screen,
) -> RenderingError:
    errors, shapes, clipped, samples = [], [], 0, 0
    for stroke in strokes:
        path = stroke.path
        scene = full_gain(texture, fitting, screen, path.sample_rate_hz)
        twin = simulator.twin(screen, FRICTION_COEFFICIENT, minutes=stroke.minutes)
        signals, missed = feel(path, scene, undone, screen, twin, stroke.minutes)
        target = target_along(texture, scene, path)
        segments = steady_segments(path, stroke.speed_mm_s)
        errors += [
            error_db(
                band_power(signals.friction_n, path.sample_rate_hz, [piece]),
                band_power(target, path.sample_rate_hz, [piece]),
            )
            for segment in segments
            for piece in thirds(segment)
        ]
        shapes.append(waveform_error(signals.friction_n, target, path.sample_rate_hz, segments))
        clipped += missed
        samples += target.size
    return RenderingError(
        rms_db(np.array(errors)), float(np.sqrt(np.mean(np.square(shapes)))), clipped / samples
    )


def thirds(segment: slice) -> list[slice]:
    """Return a segment in three parts: near its begin, in the middle, and near its end."""
    edges = np.linspace(segment.start, segment.stop, 4).astype(int).tolist()
    return [slice(begin, end) for begin, end in pairwise(edges)]
