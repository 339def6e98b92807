"""Haptic effect files of other systems, rendered as signals in time.

An effect lasts some seconds and changes as it goes: bursts, waves, curves, envelopes. Its file
says how strong in shares of a device's full scale, and mostly how sharp without saying in Hz;
what is taken for it stands in `frictus.effect_files.timeline`, and `RenderedEffect.notes` says
what was left out or limited. `frictus.load_texture` makes a texture of an effect, over time or
over position.
"""

from collections.abc import Callable
from typing import Any, Final

from frictus.effect_files.ahap import render_ahap
from frictus.effect_files.document import parsed
from frictus.effect_files.haptic import render_haptic
from frictus.effect_files.hmpg import hjif_of
from frictus.effect_files.mpeg import render_hjif
from frictus.effect_files.timeline import RenderedEffect
from frictus.errors import TextureError

_RENDERERS: Final[dict[str, Callable[[dict[str, Any]], RenderedEffect]]] = {
    ".ahap": render_ahap,
    ".haptic": render_haptic,
    ".hjif": render_hjif,
}
_BINARY: Final = ".hmpg"
EFFECT_SUFFIXES: Final = (*_RENDERERS, _BINARY)


def render_effect(content: str | bytes, suffix: str) -> RenderedEffect:
    """Render an effect file.

    Parameters
    ----------
    content : str or bytes
        The file.
    suffix : str
        Which format: ``.ahap`` (Apple Core Haptics), ``.haptic`` (Lofelt and Meta, version 1),
        ``.hjif`` or ``.hmpg`` (MPEG haptics, ISO/IEC 23090-31, as JSON or binary).

    Returns
    -------
    RenderedEffect
        The signal, full scale 1, and what was left out of it.

    Raises
    ------
    TextureError
        If it cannot be rendered; the text says what is missing, and where.
    """
    if suffix == _BINARY:
        return render_hjif(hjif_of(content.encode() if isinstance(content, str) else content))
    if suffix not in _RENDERERS:
        raise TextureError(f"{suffix}: {', '.join(EFFECT_SUFFIXES)} are rendered")
    return _RENDERERS[suffix](parsed(content))


__all__ = ["EFFECT_SUFFIXES", "RenderedEffect", "render_effect"]
