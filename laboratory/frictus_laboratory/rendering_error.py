"""A texture rendered along a path on the simulated rig, and how far off it is felt."""

from typing import Final

from frictus.textures import Texture
from frictus_hardware.physics.friction import FrictionLaw
from frictus_hardware.physics.linear import Mount
from frictus_hardware.physics.stages import Quantisation, SensorNoise, standard_twin
from frictus_laboratory.finger_prediction import RATE_HZ, SCREEN
from frictus_service.fidelity.measure import Error, compare, feel, full_gain, target_along
from frictus_service.fidelity.path import Path
from frictus_service.fidelity.preview import windows
from frictus_service.synthesis.compensation import fixed_at, uncompensated

MODES: Final = ("compensated", "fixed at 60 mm/s", "none")


def inverses(law: FrictionLaw) -> dict[str, FrictionLaw]:
    """Return the laws that the three ways of rendering invert."""
    return dict(zip(MODES, (law, fixed_at(law, 60.0), uncompensated(law)), strict=True))


def judge(
    path: Path,
    texture: Texture,
    law: FrictionLaw,
    segments: list[slice],
    modes: tuple[str, ...] = MODES,
    true_law: FrictionLaw | None = None,
    noise: bool = True,
) -> dict[str, Error]:
    """Render a texture along a path in several ways; `law` is what the service believes."""
    sensors = (SensorNoise(0.002, 0.05, 1), Quantisation()) if noise else ()
    twin = standard_twin(screen=SCREEN, law=true_law or law, sensors=sensors)
    scene = full_gain(texture, law, SCREEN, RATE_HZ)
    target = target_along(texture, scene, path)
    errors = {}
    for mode in modes:
        signals, clipped = feel(path, scene, inverses(law)[mode], SCREEN, twin)
        errors[mode] = compare(signals, clipped, target, Mount().lateral, segments)
    return errors


def whole(path: Path) -> list[slice]:
    """Return windows over all of a path but its first second."""
    first = round(RATE_HZ)
    return [
        slice(part.start + first, part.stop + first)
        for part in windows(path.position_mm.shape[0] - first, 8192)
    ]
