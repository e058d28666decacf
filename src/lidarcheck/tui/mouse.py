"""What the mouse does beside plots: it presses the keys of what is under it, and does nothing that has no key."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any

from textual import events
from textual.errors import NoWidget
from textual.geometry import Offset

from lidarcheck.tui.actions import Action
from lidarcheck.tui.bars import Bars
from lidarcheck.tui.entries import Entry, entry_at
from lidarcheck.tui.palette import Menu
from lidarcheck.tui.screens.shared.view import View
from lidarcheck.tui.threaded import Threaded
from lidarcheck.tui.widgets.lines import Lines
from lidarcheck.tui.widgets.overlay import Dialog, Overlay

__all__ = ["Mouse"]

_RIGHT, _WHEEL = 3, 3
"""The button's number; lines that the wheel goes on by."""
_GROUPS = ("%", "@", "")
"""What the chooser begins with at each group of the second line: file and model, measurement and distance, number."""


class Mouse(Threaded):
    """An app whose lines and lists can be clicked."""

    bars: Bars
    overlay: Overlay
    _pressed: Offset | None = None

    @property
    @abstractmethod
    def view(self) -> View:
        """The screen that is seen."""

    @property
    @abstractmethod
    def asking(self) -> Dialog[Any] | None:
        """The dialog that is seen."""

    @abstractmethod
    def able(self) -> list[Action]:
        """What can be done here."""

    @abstractmethod
    async def do(self, action: Action | None) -> None:
        """An action, as its key would do it."""

    @abstractmethod
    def open_with(self, typed: str) -> None:
        """The chooser, with what is typed in it."""

    @abstractmethod
    def show_menu(self, menu: Menu) -> None:
        """What can be done here."""

    async def on_event(self, event: events.Event) -> None:
        """While a dialog is seen, nothing beside its box hears of the mouse."""
        if isinstance(event, events.MouseEvent) and not event.is_forwarded and self._is_beside(event.screen_offset):
            if isinstance(event, events.MouseDown):
                self._leave_dialog()
            return
        await super().on_event(event)

    def _is_beside(self, at: Offset) -> bool:
        return self.asking is not None and not (self.overlay.visible and self.overlay.region.contains(*at))

    def _leave_dialog(self) -> None:
        """The dialog is left; what lies below was not meant, until the button is pressed again."""
        self._pressed = None
        if self.asking is not None and self.asking.listens():
            self.asking.dismiss(None)

    def on_mouse_down(self, event: events.MouseDown) -> None:
        """Where a click may begin."""
        if self._is_beside(event.screen_offset):
            self._leave_dialog()
        else:
            self._pressed = event.screen_offset

    async def on_click(self, event: events.Click) -> None:
        """A pane and its row, a tab, a key of the last line, a part of the second; twice: Enter; right: the menu."""
        pane = self._lines_at(event)
        if event.screen_offset != self._pressed or pane is None or pane is self.overlay:
            return
        column, row = event.screen_offset
        if pane in (self.bars.top, self.bars.keys):
            await self._press(entry_at(self.bars.tabs if pane is self.bars.top else self.bars.entries, column))
        elif pane is self.bars.context:
            self._choose(column)
        elif pane.can_focus:
            self.screen.set_focus(pane)
            self._go_to(pane, row)
            if event.button == _RIGHT:
                self._menu_at(column, row)
            elif event.chain == 2:
                await self._named("enter")
            else:
                self.view.clicked(pane, column - pane.region.x)

    def _lines_at(self, event: events.MouseEvent) -> Lines | None:
        """What is under the mouse."""
        try:
            widget, _ = self.get_widget_at(*event.screen_offset)
        except NoWidget:
            return None
        return widget if isinstance(widget, Lines) else None

    async def _press(self, entry: Entry | None) -> None:
        if entry is not None:
            await self.do(entry.action)

    async def _named(self, name: str) -> None:
        await self.do(next((action for action in self.able() if action.name == name), None))

    def _go_to(self, pane: Lines, row: int) -> None:
        """Move the cursor to the line there, step by step as its keys do."""
        wanted = pane.line_at(row)
        move = getattr(self.view, "action_move", None)
        if wanted is None or pane.cursor is None or move is None:
            return
        key = "down" if wanted > pane.cursor else "up"
        while pane.cursor is not None and (pane.cursor < wanted if key == "down" else pane.cursor > wanted):
            before = pane.cursor
            move(key)
            if pane.cursor == before:
                break

    def _menu_at(self, column: int, row: int) -> None:
        menu = Menu("Menu", self.able())
        menu.at = (column, row)
        self.show_menu(menu)

    def _choose(self, column: int) -> None:
        """The chooser of what stands at a column of the second line; of a number what it is computed from."""
        at, group = 0, 0
        for text, _ in self.bars.context.lines[0] if self.bars.context.lines else ():
            group += text.count("|")
            at += len(text)
            if column < at:
                break
        if group < len(_GROUPS) and _GROUPS[group]:
            self.open_with(_GROUPS[group])
        else:
            self.call_next(self._named, "inputs")

    async def on_mouse_scroll_down(self, event: events.MouseScrollDown) -> None:
        """Go on."""
        await self._wheel(event, 1)

    async def on_mouse_scroll_up(self, event: events.MouseScrollUp) -> None:
        """Go back."""
        await self._wheel(event, -1)

    async def _wheel(self, event: events.MouseEvent, by: int) -> None:
        pane = self._lines_at(event)
        if pane is None or pane is self.overlay:
            return
        if pane is self.bars.context:
            await self._named("next distance" if by > 0 else "distance before")
        elif not pane.bar:
            self.screen.set_focus(pane)
            move = getattr(self.view, "action_move", None)
            if pane.cursor is None or move is None or pane is self.bars.log:
                pane.scroll_lines(_WHEEL * by)
            else:
                for _ in range(_WHEEL):
                    move("down" if by > 0 else "up")
