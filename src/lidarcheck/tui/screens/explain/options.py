"""What the next run of Explain is asked for: its seed, and effects that it is not to name."""

from __future__ import annotations

from lidarcheck.effects.finding import find
from lidarcheck.errors import LidarcheckError
from lidarcheck.formats.table import counted
from lidarcheck.tui.screens.shared.view import View
from lidarcheck.tui.widgets.dialogs import AskText
from lidarcheck.tui.widgets.lines import line

__all__ = ["Options"]


class Options(View):
    """A screen whose runs have options, which are kept for the next start."""

    def draw(self) -> None:
        """Show them."""
        raise NotImplementedError

    def option(self, name: str) -> str:
        """What was chosen; empty for nothing."""
        return self.host.state.selected.get(f"explain {name}", "")

    def action_seed(self) -> None:
        """The seed."""
        ask = AskText("The seed of the next run: 0 to 2^64 - 1", self.option("seed"))
        self.host.ask(ask, self._seed)

    def _seed(self, text: str | None) -> None:
        if text is None:
            return
        if not (text.isascii() and text.isdecimal() and int(text) < 2**64):
            self.say(f"{text} is no seed; use a whole number from 0 to 2^64 - 1", bad=True)
            return
        self.host.state.selected["explain seed"] = text
        self.say(f"the next run has the seed {text}")
        self.draw()

    def action_exclude(self) -> None:
        """Effects that are not to be named."""
        words = [line(" Their names, with commas between them; a hyphen alone: none.")]
        ask = AskText("Effects that the next run is not to name", self.option("exclude"), words)
        self.host.ask(ask, self._exclude)

    def _exclude(self, text: str | None) -> None:
        names = [name.strip() for name in (text or "").split(",") if name.strip() not in ("", "-")]
        if text is None:
            return
        try:
            for name in names:
                find(name)
        except LidarcheckError as error:
            self.say(error)
            return
        self.host.state.selected["explain exclude"] = ",".join(dict.fromkeys(names))
        self.say(f"the next run does not name {counted(len(names), 'effect')}" if names else "all effects may be named")
        self.draw()
