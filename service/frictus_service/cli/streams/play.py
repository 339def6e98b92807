"""`frictus play` and `watch`: feel a texture from a file or the library, or look on."""

import json
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from frictus_service.cli.options import (
    AsJson,
    ConfigFile,
    RigOption,
    RouterOption,
    Seconds,
    SiteOption,
    TargetRig,
    wants_lines,
    write_line,
)

if TYPE_CHECKING:
    import frictus

PERIOD_S = 0.1
OPTIONS: Final = {
    "speed_mm_s": "--speed",
    "sample_rate_hz": "--rate",
    "scale_n": "--scale",
    "part_s": "--part",
}


def watch(
    rig: RigOption = None,
    site: SiteOption = None,
    router: RouterOption = None,
    config: ConfigFile = None,
    seconds: Seconds = None,
    as_json: AsJson = False,
) -> None:
    """Show finger, status, loop health, blocks and gaps of a rig as they come."""
    import frictus
    from frictus_service.cli.streams.felt import Display, Observer

    target = TargetRig.of(config, router, site, rig)
    with frictus.connect(target.router, tls=target.tls, patient=True) as client:
        found = target.choose(client)
        observer = Observer(found)
        with Display(f"rig {found.name} at {found.site}", wants_lines(as_json)) as display:
            never = threading.Event()
            begun_s = due_s = time.monotonic()
            while seconds is None or due_s - begun_s < seconds:
                due_s = max(due_s + PERIOD_S, time.monotonic())
                never.wait(due_s - time.monotonic())
                display.show(observer.look(), time.monotonic() - begun_s)


def play(
    texture: Annotated[
        str,
        typer.Argument(
            metavar="TEXTURE",
            help="WAV, CSV, JSON, AHAP, .haptic, HJIF or HaTT file, or the name of a texture.",
        ),
    ],
    speed: Annotated[
        float | None,
        typer.Option(
            "--speed", metavar="MM/S", help="Speed at which it was recorded, or is to be felt."
        ),
    ] = None,
    rate: Annotated[
        float | None, typer.Option("--rate", metavar="HZ", help="Rate of a one-column CSV.")
    ] = None,
    scale: Annotated[
        float | None,
        typer.Option(
            "--scale", metavar="N", help="Newtons per unit of the file.  [default: 1]"
        ),
    ] = None,
    node: Annotated[
        str | None,
        typer.Option(
            "--node", metavar="MM/S:N", help="Speed and force in a HaTT model, such as 100:1.5."
        ),
    ] = None,
    part: Annotated[
        str | None,
        typer.Option(
            "--part", metavar="S:S", help="From when to when of a file, such as 2:7.5."
        ),
    ] = None,
    gain: Annotated[
        float, typer.Option("--gain", min=0.0, max=100.0, help="Amplify it.")
    ] = 1.0,
    compensation: Annotated[
        str,
        typer.Option(
            "--compensation",
            metavar="MODE",
            help="What is inverted: model, fixed:MM/S (the model at one speed) or none.",
        ),
    ] = "model",
    rig: RigOption = None,
    site: SiteOption = None,
    router: RouterOption = None,
    config: ConfigFile = None,
    seconds: Seconds = None,
    as_json: AsJson = False,
) -> None:
    """Make a rig feel like TEXTURE, and show what the finger feels; disarms at the end."""
    import frictus
    from frictus_service.cli.streams.felt import Display, Observer

    mode = compensation_of(compensation)
    target = TargetRig.of(config, router, site, rig)
    scene = scene_of(
        texture,
        target.config.textures,
        speed,
        rate,
        scale,
        gain,
        _pair_of(part, "--part", "two times in s, such as 2:7.5"),
        _pair_of(node, "--node", "speed in mm/s and force in N, such as 100:1.5"),
    )
    lines = wants_lines(as_json)
    with frictus.connect(target.router, tls=target.tls) as client:
        found = target.choose(client)
        observer = Observer(found)
        with found.arm() as lease, Display(f"{scene.name} on {found.name}", lines) as display:
            applied = found.set_scene(scene).applied
            if mode.mode != "model":  # which holds where nothing is chosen
                mode = found.compensate(mode.mode, speed_mm_s=mode.speed_mm_s)
            if lines:
                said = {"compensation": str(mode), **applied.model_dump()}
                write_line(event="applied", rig=found.name, **said)
            begun_s = due_s = time.monotonic()
            while seconds is None or due_s - begun_s < seconds:
                due_s = max(due_s + PERIOD_S, time.monotonic())
                if lease.wait_lost(due_s - time.monotonic()):
                    raise _loss(found, lease.reason)
                display.show(observer.look(), time.monotonic() - begun_s)
        if lines:
            write_line(event="end", elapsed_s=round(time.monotonic() - begun_s, 3))


def compensation_of(text: str) -> "frictus.Compensation":
    """Return the compensation mode that an option names, such as ``fixed:60``.

    Parameters
    ----------
    text : str
        A mode, and for `fixed` a colon and the speed in mm/s.

    Raises
    ------
    ArgumentError
        If it is none.
    """
    from pydantic import ValidationError

    import frictus
    from frictus.errors import ArgumentError

    mode, colon, speed = text.partition(":")
    try:
        return frictus.Compensation.model_validate(
            {"mode": mode, "speed_mm_s": speed if colon else None}
        )
    except ValidationError as error:
        raise ArgumentError(
            f"--compensation {text}: accepted: model, none, or fixed:MM/S with 1 to 1000 mm/s, "
            "such as fixed:60"
        ) from error


def scene_of(
    texture: str,
    library: Path,
    speed_mm_s: float | None = None,
    sample_rate_hz: float | None = None,
    scale_n: float | None = None,
    gain: float = 1.0,
    part_s: tuple[float, float] | None = None,
    node: tuple[float, float] | None = None,
) -> "frictus.Scene":
    """Return the scene that an argument of the command line stands for.

    Parameters
    ----------
    texture : str
        A file, or the name of a texture of the library; a file goes first. A JSON file may
        hold a texture or a whole scene.
    library : Path
        Folder of the texture library.
    speed_mm_s, sample_rate_hz, scale_n
        How a recording was made; see `frictus.load_texture`.
    gain : float
        Multiplies the gain of every region.
    part_s : tuple of float or None
        From when to when of a recording or effect.
    node : tuple of float or None
        Of a HaTT model; see `frictus.load_texture`.

    Raises
    ------
    TextureError, FileNotFoundError
        If the file cannot be used.
    LibraryError
        If there is no such texture.
    """
    import frictus
    from frictus.errors import TextureError
    from frictus_service.library import TextureLibrary, TextureNameError

    path = Path(texture)
    if path.is_file():
        if (scene := _scene_in(path)) is None:
            try:
                found = frictus.load_texture(
                    path, speed_mm_s, sample_rate_hz, scale_n, part_s=part_s, node=node
                )
            except TextureError as error:
                raise TextureError(_by_options(str(error))) from error
            scene = frictus.Scene(name=path.stem[:100], regions=[frictus.Region(texture=found)])
    else:
        try:
            entry = TextureLibrary(library).get(texture)
        except TextureNameError as error:
            missing = "not a file:" if path.exists() else "there is no file"
            raise FileNotFoundError(f"{missing} {texture!r}") from error
        if (speed_mm_s, sample_rate_hz, scale_n, part_s, node) != (None,) * 5:
            raise TextureError("--speed, --rate, --scale, --part and --node are for files")
        scene = frictus.Scene(name=texture, regions=[frictus.Region(texture=entry.texture)])
    if gain == 1.0:
        return scene
    amplified = [region.model_dump() | {"gain": gain * region.gain} for region in scene.regions]
    return _checked_scene({"name": scene.name, "regions": amplified})


def _by_options(complaint: str) -> str:
    """Return what is wrong with a file, with the options of `play` for arguments of Python."""
    for argument, option in OPTIONS.items():
        complaint = complaint.replace(argument, option)
    return complaint


def _pair_of(text: str | None, option: str, accepted: str) -> tuple[float, float] | None:
    """Return two numbers that a colon parts."""
    from frictus.errors import ArgumentError

    if text is None:
        return None
    try:
        one, other = map(float, text.split(":"))
    except ValueError as error:
        raise ArgumentError(f"{option} {text}: {accepted}, accepted") from error
    return one, other


def _scene_in(path: Path) -> "frictus.Scene | None":
    """Return the scene of a JSON file; None if the file holds something else."""
    from frictus.errors import TextureError
    from frictus.sample_files import read_bytes

    if path.suffix.lower() != ".json":
        return None
    try:
        document = json.loads(read_bytes(path))
    except TextureError:
        raise  # too long
    except (ValueError, RecursionError):
        return None  # whoever reads it as a texture says what is wrong
    if not isinstance(document, dict) or "regions" not in document:
        return None
    return _checked_scene({"name": path.stem[:100], **document})


def _checked_scene(document: object) -> "frictus.Scene":
    from pydantic import ValidationError

    import frictus
    from frictus.errors import TextureError, explain

    try:
        as_json = json.dumps(document)
        return frictus.Scene.model_validate_json(as_json, strict=True, extra="forbid")
    except ValidationError as error:
        raise TextureError(f"not a scene: {explain(error)}") from error


def _loss(rig: "frictus.Rig", reason: str) -> Exception:
    from frictus.errors import NoRigError, RefusedError

    if not rig.present:
        return NoRigError(f"the rig has gone: {reason}")
    return RefusedError("not_owner", f"the rig took the lease away: {reason}")
