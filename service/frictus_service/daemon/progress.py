"""Whether something that takes long still moves: a start is given up for stillness, not time.

How long a first start takes hangs on the machine and on what else it does: a minute of
compiling alone, many beside busy neighbours. What is compiled is kept function by function.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final

PATIENCE_S: Final = 60.0
"""A start in which nothing moves for so long has failed."""


class StartProgress:
    """When something last moved, and what it said it was doing.

    Parameters
    ----------
    now_s : callable
        Monotonic seconds.
    """

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s = now_s
        self.begin()

    def begin(self) -> None:
        """Start anew; seconds count from here."""
        self._began_s = self._moved_s = self._now_s()
        self.step = "starting"

    def move(self, step: str = "") -> float:
        """Note that something moved; return the seconds since it began.

        Parameters
        ----------
        step : str
            What is done from now on; empty for the same as before.
        """
        self._moved_s = self._now_s()
        self.step = step or self.step
        return self._moved_s - self._began_s

    def left_s(self, patience_s: float) -> float:
        """Return how much longer it may stand still; 0 or less: it has for too long."""
        return self._moved_s + patience_s - self._now_s()


@contextmanager
def compiling_told(
    on_function: Callable[[str], None], on_pass: Callable[[], None]
) -> Iterator[None]:
    """Tell of what this process compiles meanwhile; what comes from the cache is not told.

    Parameters
    ----------
    on_function : callable
        Called with the name of each function as its compilation begins.
    on_pass : callable
        Called as each pass of the compiler begins, some hundred for a function.
    """
    from numba.core import event  # late: a supervisor does without

    class Told(event.Listener):
        def on_start(self, event: event.Event) -> None:
            if event.kind == "numba:compile":
                on_function(event.data["dispatcher"].py_func.__name__)
            else:
                on_pass()

        def on_end(self, event: event.Event) -> None:
            """Do nothing: the next beginning says enough."""

    with (
        event.install_listener("numba:compile", Told()),
        event.install_listener("numba:run_pass", Told()),
    ):
        yield
