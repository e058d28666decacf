"""What threads want done in the interface's own: they hand it on, and it is done in its order."""

from __future__ import annotations

import contextlib
import inspect
from collections.abc import Callable
from typing import Any

from textual.app import App
from textual.message import Message

__all__ = ["Threaded"]


class Threaded(App[int]):
    """An app that threads may ask to do something."""

    class Soon(Message):
        """Something that a thread wants done in the interface's own."""

        def __init__(self, do: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
            super().__init__()
            self.do, self.arguments = do, arguments

    def soon(self, do: Callable[..., Any], *arguments: Any) -> None:
        """Do something in the interface's own thread; from any thread, also when the interface has ended."""
        with contextlib.suppress(RuntimeError):
            self.post_message(self.Soon(do, arguments))

    async def on_threaded_soon(self, message: Soon) -> None:
        """What a thread has asked for; nothing any more while the interface ends and its panes are going."""
        if not self.is_running:
            return
        done = message.do(*message.arguments)
        if inspect.isawaitable(done):
            await done
