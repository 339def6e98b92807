"""What a with statement opens and closes."""

from abc import ABC, abstractmethod
from types import TracebackType
from typing import Self


class Opened(ABC):
    """Opened at the beginning of a with statement, and closed at its end, whatever happened."""

    @abstractmethod
    def open(self) -> None:
        """Open."""

    @abstractmethod
    def close(self) -> None:
        """Close. Closing twice is harmless."""

    def __enter__(self) -> Self:
        """Open and return self."""
        self.open()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Close."""
        self.close()
