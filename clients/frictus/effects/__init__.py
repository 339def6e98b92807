"""Haptic effect files of other systems, rendered as signals in time.

An effect lasts some seconds and changes as it goes: bursts, waves, curves, envelopes. Its file
says how strong in shares of a device's full scale, and mostly how sharp without saying in Hz;
what is taken for it stands in `frictus.effects.timeline`, and `Effect.notes` says what was left
out or limited. `frictus.load_texture` makes a texture of an effect, over time or position.
"""

from collections.abc import Callable
from typing import Any, Final

from frictus.effects.ahap import render_ahap
from frictus.effects.document import parsed
from frictus.effects.haptic import render_haptic
from frictus.effects.mpeg import render_hjif
from frictus.effects.timeline import Effect
from frictus.errors import TextureError

_RENDERERS: Final[dict[str, Callable[[dict[str, Any]], Effect]]] = {
    ".ahap": render_ahap,
    ".haptic": render_haptic,
    ".hjif": render_hjif,
}
EFFECT_SUFFIXES: Final = tuple(_RENDERERS)


def render_effect(text: str, suffix: str) -> Effect:
    """Render an effect file.

    Parameters
    ----------
    text : str
        The file.
    suffix : str
        Which format: ``.ahap`` (Apple Core Haptics), ``.haptic`` (Lofelt and Meta, version 1)
        or ``.hjif`` (MPEG haptics, ISO/IEC 23090-31).

    Returns
    -------
    Effect
        The signal, full scale 1, and what was left out of it.

    Raises
    ------
    TextureError
        If it cannot be rendered; the text says what is missing, and where.
    """
    if suffix not in _RENDERERS:
        raise TextureError(f"{suffix}: {', '.join(EFFECT_SUFFIXES)} are rendered")
    return _RENDERERS[suffix](parsed(text))


__all__ = ["EFFECT_SUFFIXES", "Effect", "render_effect"]
