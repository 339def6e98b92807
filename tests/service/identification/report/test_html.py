"""Figures within a page."""

import base64

from matplotlib.figure import Figure

from frictus_service.identification.report.html import picture


def test_letters_that_no_font_has_are_drawn_without_a_warning() -> None:
    """A participant may have any name; the library's warning helps nobody."""
    figure = Figure(layout="constrained")
    figure.subplots().set_title("山田 \ue000")
    stored = base64.b64decode(picture(figure).removeprefix("data:image/png;base64,"))
    assert stored.startswith(b"\x89PNG")
