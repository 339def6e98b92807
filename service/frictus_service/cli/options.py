"""Options that several commands share, and what they stand for."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

if TYPE_CHECKING:
    import frictus
    from frictus_service.config import Config

AsJson = Annotated[bool, typer.Option("--json", help="JSON, one object per line.")]
ConfigFile = Annotated[
    Path | None,
    typer.Option(
        "--config", "-c", metavar="FILE", help="Configuration.  [default: frictus.toml]"
    ),
]
RouterOption = Annotated[
    str | None,
    typer.Option("--router", metavar="ENDPOINT", help="Router.  [default: as configured]"),
]
SiteOption = Annotated[
    str | None, typer.Option("--site", help="Site of the rig.  [default: as configured]")
]
RigOption = Annotated[str | None, typer.Option("--rig", help="Rig.  [default: the only one]")]
Seconds = Annotated[
    float | None, typer.Option("--seconds", min=0.0, help="How long.  [default: until Ctrl-C]")
]
Workers = Annotated[
    int | None,
    typer.Option("--workers", min=0, help="Processes.  [default: one per processor]"),
]
RandomSeed = Annotated[
    int | None, typer.Option("--seed", min=0, help="Of random draws.  [default: fresh]")
]
Response = Annotated[
    Literal["friction", "mobility"],
    typer.Option("--response", help="From drive to friction, or from friction to skin."),
]


@dataclass(frozen=True, slots=True)
class TargetRig:
    """Which rig a command is about: what the options say, else the configuration.

    Attributes
    ----------
    config : Config
        The configuration file's, or the defaults.
    router, site : str
        Endpoint of the router, and site.
    rig : str or None
        None: the only rig of the site.
    """

    config: "Config"
    router: str
    site: str
    rig: str | None

    @property
    def tls(self) -> "frictus.Tls | None":
        """What a command presents to the router."""
        return self.config.tls("client")

    @classmethod
    def of(
        cls, config: Path | None, router: str | None, site: str | None, rig: str | None
    ) -> "TargetRig":
        """Return the target of the given options.

        Raises
        ------
        ConfigurationError
            If the configuration file cannot be used.
        """
        from frictus_service.config import load

        loaded = load(config)
        return cls(loaded, router or loaded.router.endpoint, site or loaded.site, rig)

    def choose(self, client: "frictus.Client") -> "frictus.Rig":
        """Return the rig.

        Raises
        ------
        NoRigError
            If it is not present; or none was named, and none or several are present.
        """
        from frictus.errors import NoRigError

        if self.rig is not None:
            return client.rig(self.rig, self.site)
        present = [found.name for found in client.rigs(self.site)]
        if not present:
            return client.rig(self.config.rig, self.site)  # waits for one that is starting
        if len(present) > 1:
            raise NoRigError(
                f"site {self.site!r} has several rigs: {', '.join(present)}; "
                "name one with --rig"
            )
        return client.rig(present[0], self.site)


def wants_lines(as_json: bool) -> bool:
    """Return whether to write JSON lines: asked for, or nobody looks at a terminal."""
    return as_json or not sys.stdout.isatty()
