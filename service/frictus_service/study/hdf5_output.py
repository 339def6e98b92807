"""Where HDF5 writes a file, so that a full disk is an error and not the end of the process."""

import contextlib
import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from frictus_service.errors import NotWrittenError


class Hdf5Output(io.FileIO):
    """A new file for `h5py.File` to write to.

    HDF5 does not recover from a write that fails: it raises from every close, and ends the
    process by a segmentation fault. So it is never told; what it fails by later, where it reads
    what it takes for written, `in_whole` puts into words.

    Parameters
    ----------
    path : Path
        Of the file.

    Attributes
    ----------
    failure : OSError or None
        Of the first write that failed; none was done after it.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path, "w+")
        self.failure: OSError | None = None

    @contextlib.contextmanager
    def in_whole(self, path: Path) -> Iterator[None]:
        """Have HDF5 write.

        Parameters
        ----------
        path : Path
            What the file is to be called.

        Raises
        ------
        NotWrittenError
            If not all of it was written, whatever else HDF5 raised.
        """
        try:
            yield
        except Exception:
            if self.failure is None:
                raise
        if self.failure is not None:
            raise not_written(path, self.failure) from self.failure

    def write(self, data: Any, /) -> int:
        """Write all of it, unless a write has failed."""
        left = memoryview(data).cast("B")
        size = left.nbytes
        try:
            while left and self.failure is None:
                left = left[super().write(left) :]
        except OSError as error:
            self.failure = error
        return size

    def truncate(self, size: int | None = None, /) -> int:
        """Set the length, unless a write has failed."""
        try:
            return super().truncate(size) if self.failure is None else 0
        except OSError as error:
            self.failure = error
            return 0


def not_written(path: Path, error: OSError) -> NotWrittenError:
    """Return what to say of a file that could not be written.

    Parameters
    ----------
    path : Path
        What the file is to be called.
    error : OSError
        Why.
    """
    return NotWrittenError(
        f"{path} cannot be written: {error.strerror or error}; nothing is kept of it. Make "
        "room there, or choose a folder that this account may write, and ask again"
    )
