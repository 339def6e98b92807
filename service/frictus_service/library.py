"""The texture library: one JSON file per texture in a folder, beside those that are shipped.

A file is replaced in one step (written beside, then renamed), so that a reader sees the old
texture or the new one and a crash leaves no torn file. Every texture has an etag, the hash of
its content, and a writer names the etag it saw: two writers cannot overwrite one another
unknowingly. One process writes to a folder; any number may read.
"""

import hashlib
import re
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from pydantic import TypeAdapter, ValidationError

from frictus.errors import UnreadableFileError
from frictus.files import sync_folder
from frictus.keys import RESERVED
from frictus.textures import Texture
from frictus_service import json_text
from frictus_service.durable import replace_file
from frictus_service.errors import ServiceError

SHIPPED: Final = Path(__file__).parent / "textures"
# Lower case only: Sand.json and sand.json are one file on Windows and two on Linux.
NAME: Final = "[a-z0-9][a-z0-9_-]{0,63}"
"""What a texture can be called, as a pattern."""
_NAME: Final = re.compile(NAME, re.ASCII)
_TEXTURE: Final[TypeAdapter[Texture]] = TypeAdapter(Texture)

NAMED_IN_ERRORS = 12


class LibraryError(ServiceError):
    """Base of what the library refuses."""


class TextureNameError(LibraryError, ValueError):
    """A name that no texture can have."""


class UnknownTextureError(LibraryError, LookupError):
    """There is no texture of this name."""


class ReadOnlyTextureError(LibraryError, PermissionError):
    """A shipped texture cannot be replaced or deleted."""


class TextureConflictError(LibraryError, RuntimeError):
    """The texture is not the one the caller saw."""


class DamagedTextureError(LibraryError, ValueError):
    """A file of the library does not hold a texture; the text says where and why."""


@dataclass(frozen=True, slots=True)
class Entry:
    """One texture of the library.

    Attributes
    ----------
    name : str
        1 to 64 lower-case letters, digits, ``-`` and ``_``.
    texture : Texture
        What it holds.
    etag : str
        Hash of the content.
    shipped : bool
        Comes with the package; read-only.
    """

    name: str
    texture: Texture
    etag: str
    shipped: bool


class TextureLibrary:
    """Textures by name.

    Parameters
    ----------
    folder : Path
        The user's textures; made with the first `put`.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._writing = threading.Lock()

    def names(self) -> list[str]:
        """Return all names, sorted; files whose names no texture can have are left out."""
        return sorted(_names_in(self._folder) | _names_in(SHIPPED))

    def get(self, name: str) -> Entry:
        """Return the texture called `name`.

        Raises
        ------
        TextureNameError, UnknownTextureError, DamagedTextureError
        """
        check_name(name)
        for folder, shipped in ((SHIPPED, True), (self._folder, False)):
            path = folder / f"{name}.json"
            if not path.is_file():
                continue
            try:
                content = json_text.read_file(path)
            except FileNotFoundError:  # deleted since
                continue
            except UnreadableFileError as error:
                raise DamagedTextureError(f"{path.name} of the library: {error}") from error
            return _entry(name, content, path, shipped)
        held = self.names()
        few = ", ".join(held[:NAMED_IN_ERRORS]) + (", …" if len(held) > NAMED_IN_ERRORS else "")
        raise UnknownTextureError(f"no texture {name!r} in the library; it holds {few}")

    def put(self, name: str, texture: Texture, replaces: str | None) -> Entry:
        """Write a texture.

        Parameters
        ----------
        name : str
            1 to 64 lower-case letters, digits, ``-`` and ``_``.
        texture : Texture
            What to write.
        replaces : str or None
            Etag of the texture that it replaces, ``*`` for whichever stands there, None when
            there must be none yet.

        Raises
        ------
        TextureNameError, ReadOnlyTextureError, TextureConflictError
        """
        check_name(name)
        self._refuse_shipped(name)
        content = _TEXTURE.dump_json(texture)
        with self._writing:
            self._check_replaced(name, replaces)
            self._folder.mkdir(parents=True, exist_ok=True)
            replace_file(self._folder / f"{name}.json", content)
        return Entry(name, texture, etag_of(texture), shipped=False)

    def delete(self, name: str, replaces: str) -> None:
        """Delete the texture with the etag `replaces` (``*``: whichever stands there).

        Raises
        ------
        TextureNameError, UnknownTextureError, ReadOnlyTextureError, TextureConflictError
        """
        check_name(name)
        self._refuse_shipped(name)
        with self._writing:
            if not (self._folder / f"{name}.json").exists():
                raise UnknownTextureError(f"no texture {name!r} in the library")
            self._check_replaced(name, replaces)
            (self._folder / f"{name}.json").unlink()
            sync_folder(self._folder)

    def _refuse_shipped(self, name: str) -> None:
        if (SHIPPED / f"{name}.json").exists():
            raise ReadOnlyTextureError(f"{name!r} is shipped and read-only: use another name")

    def _check_replaced(self, name: str, replaces: str | None) -> None:
        if not (self._folder / f"{name}.json").exists():
            if replaces is not None:
                raise TextureConflictError(f"there is no texture {name!r} to replace")
            return
        if replaces is None:
            raise TextureConflictError(f"there is a texture {name!r} already")
        if replaces == "*":  # also the way out of a damaged file, which has no etag
            return
        if (etag := self.get(name).etag) != replaces:
            raise TextureConflictError(f"texture {name!r} has changed: its etag is {etag}")


def etag_of(texture: Texture) -> str:
    """Return the hash that stands for a texture's content."""
    return hashlib.sha256(_TEXTURE.dump_json(texture)).hexdigest()[:32]


def check_name(name: str) -> None:
    """Raise if a texture cannot be called that.

    Raises
    ------
    TextureNameError
    """
    if not _NAME.fullmatch(name) or RESERVED.fullmatch(name):
        raise TextureNameError(
            f"texture name {name[:80]!r}: 1 to 64 lower-case letters, digits, '-' and '_' are "
            "accepted, beginning with a letter or digit; device names such as 'nul' are not"
        )


def _names_in(folder: Path) -> set[str]:
    names = {path.stem for path in folder.glob("*.json") if path.is_file()}
    return {name for name in names if _NAME.fullmatch(name) and not RESERVED.fullmatch(name)}


def _entry(name: str, content: bytes, path: Path, shipped: bool) -> Entry:
    try:
        texture = _TEXTURE.validate_json(content, strict=True)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        place = ".".join(str(part) for part in first["loc"]) or "the document"
        raise DamagedTextureError(
            f"{path.name} of the library does not hold a texture: {place}: {first['msg']}. "
            "Replace or delete it."
        ) from error
    return Entry(name, texture, etag_of(texture), shipped)
