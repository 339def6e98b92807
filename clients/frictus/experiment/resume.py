"""An experiment that was interrupted goes on where its log ends."""

from typing import Any

from frictus.errors import ArgumentError
from frictus.experiment.protocol import Protocol
from frictus.experiment.schedule import Schedule


def resumed(protocol: Protocol, rows: list[dict[str, Any]], source: str = "log") -> Schedule:
    """Return a schedule that stands where the rows of a log end.

    Parameters
    ----------
    protocol : Protocol
        The experiment; it must be the one of the log.
    rows : list of dict
        Header and trials.
    source : str
        Name of the log, for messages.

    Raises
    ------
    ArgumentError
        If the log is of another protocol, or its trials are not those of this one.
    """
    header = rows[0]
    try:
        held = Protocol.model_validate(header["protocol"])
        schedule = Schedule(held, int(header["seed"]), int(header["order_row"]))
    except (KeyError, TypeError, ValueError) as error:
        raise ArgumentError(f"{source}: its header cannot be read: {error}") from error
    if held != protocol:
        changed = [
            name
            for name in type(protocol).model_fields
            if getattr(held, name) != getattr(protocol, name)
        ]
        raise ArgumentError(
            f"{source} was begun with another protocol ({', '.join(changed)} differ): go on "
            "with that one, or begin a new log"
        )
    for row in rows:
        if "trial" not in row:
            continue
        trial = schedule.next()
        same = trial is not None and all(
            row.get(name) == value
            for name, value in (
                ("trial", trial.number),
                ("phase", trial.phase),
                ("condition", trial.condition),
                ("catch", trial.catch),
                ("order", list(trial.order)),
            )
        )
        if trial is None or not same:
            raise ArgumentError(
                f"{source}, trial {row.get('trial')!r}: not the one that this version of the "
                "protocol presents; it cannot be gone on with"
            )
        if row.get("status") == "refused":
            schedule.refuse(trial)
        elif isinstance(level := row.get("level_rendered"), int | float):
            schedule.record(trial, float(level), row.get("positive"))
        else:
            raise ArgumentError(f"{source}, trial {trial.number}: no level_rendered")
    return schedule
