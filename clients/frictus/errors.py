"""Every error the client raises on purpose; each is also the natural builtin."""


class FrictusError(Exception):
    """Base of every error of this package."""


class FrameError(FrictusError, ValueError):
    """Bytes on the wire are not a frame of the protocol; the text says which field and why."""


class TextureError(FrictusError, ValueError):
    """A texture or scene cannot be represented; the text says what is accepted."""


class RefusedError(FrictusError, RuntimeError):
    """The rig refused a command.

    Attributes
    ----------
    code : str
        Stable word for programs: one of `frictus.messages.RefusalCode`.
    """

    def __init__(self, code: str, message: str) -> None:
        super().__init__(message)
        self.code = code


class NoRigError(FrictusError, LookupError):
    """No rig answers under the given name."""


class LinkError(FrictusError, ConnectionError):
    """No router can be reached, or the link to it is gone."""
