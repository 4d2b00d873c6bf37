"""What could not be read of a bag."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class Loss:
    """The unreadable parts of a file; complete when the messages have been iterated to the end."""

    messages: int = 0
    exact: bool = False  # the file itself says how many messages it had; else `messages` is the least
    bytes: int = 0
    places: int = 0
    cut: bool = False  # the file was never closed: data in the recorder's memory is missing

    def __bool__(self) -> bool:
        return bool(self.messages or self.places or self.cut)

    def __str__(self) -> str:
        if not self:
            return "nothing lost"
        count = f"{'' if self.exact else 'at least '}{self.messages} message(s) lost"
        if not self.exact and not self.messages:
            count = "how many messages are lost is not known"
        unread = f", {self.bytes} bytes unreadable in {self.places} place(s)" if self.places else ""
        return count + unread + (", the end is missing because the file was never closed" if self.cut else "")

    def __add__(self, other: Loss) -> Loss:
        return Loss(
            self.messages + other.messages,
            self.exact and other.exact,
            self.bytes + other.bytes,
            self.places + other.places,
            self.cut or other.cut,
        )

    def add(self, size: int) -> None:
        """Count another unreadable place of `size` bytes."""
        self.places += 1
        self.bytes += size
