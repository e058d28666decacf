"""What is held between two questions, by what it was made from: the last used, up to a number."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

__all__ = ["Memo"]

_Value = TypeVar("_Value")


class Memo(Generic[_Value]):
    """Values by key, of which the least used are forgotten first; for one thread."""

    def __init__(self, most: int) -> None:
        self.most = most
        self._held: dict[Hashable, _Value] = {}

    def get(self, key: Hashable, make: Callable[[], _Value]) -> _Value:
        """The value of a key, made where it is not held."""
        value = self._held.pop(key) if key in self._held else make()
        self.put(key, value)
        return value

    def put(self, key: Hashable, value: _Value) -> None:
        """Hold a value, in the place of an older one."""
        self._held.pop(key, None)
        self._held[key] = value
        while len(self._held) > self.most:
            del self._held[next(iter(self._held))]

    def held(self, key: Hashable) -> _Value | None:
        """The value of a key, None where it is not held."""
        return self._held.get(key)
