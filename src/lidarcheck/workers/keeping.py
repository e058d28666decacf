"""What a worker keeps between tasks: shared things, once for each of its threads, since threads do not share them."""

from __future__ import annotations

import pickle
import threading
from collections import OrderedDict
from collections.abc import Callable
from typing import Any

__all__ = ["kept"]

_MOST = 4
"""So many things a thread keeps; a task needs no more than two."""
_of_thread = threading.local()


def kept(key: str, content: bytes | Callable[[], bytes]) -> Any:
    """The thing of this key: as this thread keeps it, or unpacked now from its bytes, or from what brings them."""
    things: OrderedDict[str, Any] = _of_thread.__dict__.setdefault("things", OrderedDict())
    if key not in things:
        while len(things) >= _MOST:
            things.popitem(last=False)
        # Written by the process that started this work.
        things[key] = pickle.loads(content() if callable(content) else content)
    things.move_to_end(key)
    return things[key]
