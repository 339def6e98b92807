"""The command line. `frictus --help` lists the commands and the exit codes.

What a command needs is imported when it runs, so that `frictus --help` answers at once.
"""

import io
import os
import sys


def main() -> None:
    """Run the command line of this process."""
    open_standard_streams()
    from frictus_service.cli.app import app
    from frictus_service.processes import quiet_numerics

    quiet_numerics()
    app()


def open_standard_streams() -> None:
    """Put nothing in place of a standard stream that whoever started us has closed.

    The next file that is opened, a recording or the database, would take its number, and what
    parts print would be written into it. What the encoding of the output lacks is escaped, as
    on standard error: a table with a µ would end the command on a terminal of ASCII.
    """
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            number = os.open(os.devnull, os.O_RDWR)  # the lowest that is free: that of the name
            os.set_inheritable(number, True)
            setattr(sys, name, open(number, mode, encoding="utf-8"))
    if isinstance(sys.stdout, io.TextIOWrapper):  # consoles of notebooks have their own
        sys.stdout.reconfigure(errors="backslashreplace")
