"""Ctrl-C while a rig is open is put off to the end of a block, so that it is closed whole."""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def interrupt_put_off() -> Iterator[Callable[[], bool]]:
    """Yield a function that says whether Ctrl-C was pressed; nothing is torn by it meanwhile.

    Outside of the main thread, which alone hears Ctrl-C, it changes nothing.

    Raises
    ------
    KeyboardInterrupt
        At the end, if it was pressed and nothing else is raised.
    """
    pressed = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield pressed.is_set
        return
    former = signal.signal(signal.SIGINT, lambda _number, _frame: pressed.set())
    try:
        yield pressed.is_set
    finally:
        signal.signal(signal.SIGINT, former)
    if pressed.is_set():
        raise KeyboardInterrupt
