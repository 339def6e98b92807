"""How a report becomes one HTML file: its template, colours, numbers, and figures within it."""

import base64
import io
import warnings
from collections.abc import Callable, Mapping
from importlib import resources
from importlib.resources.abc import Traversable
from typing import Any

import jinja2
import matplotlib as mpl
import numpy as np
from markupsafe import Markup
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.font_manager import fontManager
from matplotlib.text import Text

ORDER = mpl.colormaps["viridis"]
"""Of what comes in an order: sweeps, speeds."""
FIT = "#c1272d"
GRID: dict[str, Any] = {"alpha": 0.3, "lw": 0.6}
FONTS = (
    "DejaVu Sans",
    "Noto Sans CJK JP",
    "Microsoft YaHei",
    "Yu Gothic",
    "Malgun Gothic",
    "PingFang SC",
    "Hiragino Sans",
)
"""Of which those that are installed are used: the first has no letters of eastern Asia."""


def people(n: int) -> list[tuple[float, float, float, float]]:
    """Return a colour per participant."""
    colours = mpl.colormaps["tab10" if n <= 10 else "tab20"]
    assert isinstance(colours, ListedColormap)
    return [tuple(colours(i % colours.N)) for i in range(n)]  # type: ignore[misc]


def ordered(n: int) -> list[tuple[float, float, float, float]]:
    """Return a colour per level of something ordered."""
    return [tuple(colour) for colour in ORDER(np.linspace(0.05, 0.9, n))]


_DPI = 110


def fill(
    template: Traversable, filters: Mapping[str, Callable[..., str]], **values: object
) -> str:
    """Return a filled-in template; it may use ``css`` and the filters ``number`` and ``p``.

    Parameters
    ----------
    template : Traversable
        A Jinja file of the package.
    filters : mapping of str to callable
        Further filters of this template.
    values
        What it names; a name without value is an error.
    """
    environment = jinja2.Environment(
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    own: dict[str, Callable[..., Any]] = {"number": number, "p": p_value}
    environment.filters |= own | dict(filters)
    css = resources.files(__package__).joinpath("page.css").read_text(encoding="utf-8")
    made = environment.from_string(template.read_text(encoding="utf-8"))
    return made.render(css=Markup(css), **values)


def picture(figure: Figure) -> str:
    """Return a figure as a data URI; a letter that no installed font has is a box."""
    stored = io.BytesIO()
    installed = {font.name for font in fontManager.ttflist}
    for text in figure.findobj(Text):
        text.set_fontfamily([name for name in FONTS if name in installed])
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing from", UserWarning)
        figure.savefig(stored, format="png", dpi=_DPI)
    return "data:image/png;base64," + base64.b64encode(stored.getvalue()).decode("ascii")


def number(value: float | None, digits: int = 4) -> str:
    """Return a number for reading; a dash where it is not known."""
    if value is None:
        return "-"
    return f"{value:.{digits}g}"


def p_value(value: float | None) -> str:
    """Return a p value for reading."""
    if value is None:
        return "-"
    return "<0.001" if value < 0.001 else f"{value:.3f}"
