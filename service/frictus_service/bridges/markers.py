"""What happens on a rig, as short texts with a time: markers of an experiment's recording."""

from collections.abc import Iterator
from dataclasses import dataclass, field

from frictus.messages import GuidanceState, Message, RigStatus, SceneState


@dataclass(frozen=True, slots=True)
class Marker:
    """An event.

    Attributes
    ----------
    utc_ns : int
        When, by the rig's clock; 0: it does not say.
    text : str
        One word that says what kind it is, and what it is.
    """

    utc_ns: int
    text: str


@dataclass(slots=True)
class MarkerDetector:
    """Finds what has changed in what a rig says again and again; the first is a change, too."""

    _last: dict[str, str] = field(default_factory=dict)

    def markers_of(self, message: Message) -> list[Marker]:
        """Return what has changed with a message.

        Parameters
        ----------
        message : Message
            A scene, a status or a guidance; others change nothing.
        """
        found = []
        for utc_ns, kind, detail in _facts(message):
            if self._last.get(kind) != detail:
                known = kind in self._last
                self._last[kind] = detail
                if detail or known:  # no fault is no event before there was one
                    found.append(Marker(utc_ns, f"{kind} {detail or 'cleared'}"))
        return found


def _facts(message: Message) -> Iterator[tuple[int, str, str]]:
    """Yield time, kind and value of what a message says."""
    match message:
        case SceneState():
            name = f" {message.scene.name}" if message.scene.name else ""
            source = "" if message.source == "scene" else f"{message.source} "
            yield message.utc_ns or 0, "scene", f"{source}{message.etag}{name}"
        case RigStatus():
            yield message.utc_ns, "run", str(message.run)
            yield message.utc_ns, "state", message.state
            fault = message.fault
            if fault is None:
                yield message.utc_ns, "fault", ""
            else:
                yield fault.utc_ns, "fault", f"{fault.kind}: {fault.reason}"
        case GuidanceState():
            yield message.utc_ns, "trial", f"{message.trial} {message.phase}"
