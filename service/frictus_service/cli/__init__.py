"""The command line. `frictus --help` lists the commands and the exit codes.

What a command needs is imported when it runs, so that `frictus --help` answers at once.
"""


def main() -> None:
    """Run the command line of this process."""
    from frictus_service.cli.app import app
    from frictus_service.processes import quiet_numerics

    quiet_numerics()
    app()
