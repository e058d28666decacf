"""The application: composes bars, screens and log, reads the project beside them, and hands on what threads find."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import signal
import threading
from dataclasses import replace
from multiprocessing import resource_tracker
from pathlib import Path
from typing import Any, ClassVar

from textual import events
from textual.app import ComposeResult
from textual.driver import Driver
from textual.geometry import Size
from textual.widgets import ContentSwitcher

from lidarcheck.errors import LidarcheckError
from lidarcheck.formats.table import counted
from lidarcheck.session.choice import Choice, Part
from lidarcheck.session.disk_store import DiskStore
from lidarcheck.session.kept_history import KeptHistory
from lidarcheck.session.model_choice import features_of_models, other_sensors
from lidarcheck.session.project import Project, read_project
from lidarcheck.session.session import Session
from lidarcheck.session.state import load_state, save_state
from lidarcheck.session.store import Store
from lidarcheck.session.worker import Worker
from lidarcheck.tui.actions import SCREENS
from lidarcheck.tui.bars import Bars
from lidarcheck.tui.context import context_line
from lidarcheck.tui.edits import Edits
from lidarcheck.tui.everywhere import Everywhere
from lidarcheck.tui.help import LogHandler
from lidarcheck.tui.jobs.checks import Runs
from lidarcheck.tui.numbers import Numbers
from lidarcheck.tui.plots.marks import level_of
from lidarcheck.tui.runs.starting import Commands
from lidarcheck.tui.screens import later_screens
from lidarcheck.tui.screens.blooming.editor import Editor
from lidarcheck.tui.screens.overview.screen import Overview
from lidarcheck.tui.screens.shared.view import View, bindings
from lidarcheck.tui.widgets.dialogs import Ask
from lidarcheck.tui.widgets.lines import line
from lidarcheck.tui.widgets.overlay import Overlay
from lidarcheck.tui.widgets.themes import THEMES, textual_themes

__all__ = ["LidarcheckApp", "run"]

_HANGUP = 129


class LidarcheckApp(Everywhere):
    """The interface on one project; a `host.Host`. `check` stands in for the harness's in tests; without a `worker` no
    number is computed.

    `marks`: what plots are made of, one of `plots.marks.MARKS`; by default as last, else what the terminal can show.
    """

    ENABLE_COMMAND_PALETTE = False
    BINDINGS: ClassVar[list[Any]] = bindings("")
    CSS = """
    Screen { background: $background; layers: default over; }
    View { height: 1fr; width: 1fr; }
    ContentSwitcher { height: 1fr; }
    View .zoomed { dock: none; width: 1fr !important; height: 1fr !important; min-height: 100%; max-height: 100%; }
    #log { height: 7; display: none; }
    #log.shown { display: block; }
    """

    ALLOW_SELECT: ClassVar[bool] = False

    def __init__(
        self,
        root: Path,
        *,
        theme: str = "",
        screen: str = "",
        marks: str = "",
        check: Any = None,
        worker: Worker | None = None,
        driver: type[Driver] | None = None,
    ) -> None:
        # Without colours the terminal's own two are left as they are: a theme's would be sent as greys.
        super().__init__(driver_class=driver, ansi_color=True if "NO_COLOR" in os.environ else None)
        self.project = Project(root)
        self.reads = 0
        self.session = Session(Store(disk=DiskStore(root)), worker, KeptHistory(root))
        self._told = False
        self._columns, self._last_size = 0, Size(0, 0)
        self.state = load_state(root)
        self.choice = Choice(self.state.selected)
        self.numbers = Numbers(
            self.project, self.session, self.choice, self.set_timer, self.soon, self.say, self._wait,
            on=worker is not None,
        )  # fmt: skip
        self.state.marks = marks or self.state.marks
        self.marks = level_of(self.state.marks, os.environ)
        self.animation_level = "none"
        self._wanted = screen or self.state.screen
        for known in textual_themes():
            self.register_theme(known)
        wanted = theme or self.state.theme
        # Before the first paint, which would be sent again in the theme's colours.
        self.set_reactive(LidarcheckApp.theme, wanted if wanted in THEMES else THEMES[0])
        self.bars = Bars()
        self.overlay = Overlay(self._anchor)
        self._awaited = ""
        self._unseen = contextlib.ExitStack()
        self._warnings = LogHandler(self.soon, self.note)
        self.commands = Commands(self, self._view_of)
        self.edits = Edits(self, self._editors, lambda: self.view.edited())
        self._views: tuple[View, ...] = (Overview(Runs(root), check),)
        self._switcher = ContentSwitcher(initial=self._views[0].NAME)

    def compose(self) -> ComposeResult:
        """Two bars above, the screens, the log, and two bars below; over all of it the box of dialogs."""
        yield from (self.bars.top, self.bars.context)
        with self._switcher:
            yield from self._views
        yield from (self.bars.log, self.bars.below, self.bars.keys, self.overlay)

    def on_load(self) -> None:
        """Nothing is sent before the first screen is whole: its parts would be sent several times."""
        self._unseen.enter_context(self.batch_update())

    def on_mount(self) -> None:
        """Screen and log as they were; then read the project beside the interface."""
        self.call_after_refresh(self._unseen.close)
        screen = self._wanted
        logging.getLogger("lidarcheck").addHandler(self._warnings)
        self.bars.log.set_class(self.state.log, "shown")
        self.show_screen(next(iter(SCREENS)))
        self.watch(self.screen, "focused", self._show_keys, init=False)
        if screen in SCREENS:
            self.show_screen(screen)
        self._listen()
        self.choice.on_change = self._choice_changed
        self.numbers.engine.on_change = self._numbers_changed
        self.session.on_change = self._inputs_changed
        self.session.watch()
        self.read_project()

    def _inputs_changed(self) -> None:
        """In any thread: have the screens say what belongs to what, once for all that happens meanwhile."""
        if not self._told:
            self._told = True
            self.soon(self._tell)

    def _tell(self) -> None:
        self._told = False
        self.numbers.inputs_changed()
        for view in self.views():
            view.inputs_changed()
        self.show_context()

    def _choice_changed(self, _part: Part) -> None:
        """Every screen is a view of one choice."""
        self.numbers.ask()
        for view in self.views():
            view.choice_changed()
        self.show_context()

    def _numbers_changed(self) -> None:
        self.view.numbers_changed()
        self.show_context()

    def show_context(self) -> None:
        """The second line, as it is now."""
        width = self._columns or self.size.width
        context = self.numbers.context()
        context = replace(context, known=replace(context.known, state=self.inside(context.known.state)))
        self.bars.context.show([self.view.context_line(width) or context_line(context, width)])

    def _listen(self) -> None:
        """End well when told to, and at once when the terminal is gone."""
        with contextlib.suppress(NotImplementedError, RuntimeError, ValueError):
            loop = asyncio.get_running_loop()
            loop.add_signal_handler(signal.SIGTERM, self.exit, 143)
            loop.add_signal_handler(signal.SIGHUP, self._hung_up)

    def _hung_up(self) -> None:
        # There is no terminal to restore. What was edited is in the journal, and stays for the next start.
        save_state(self.state, self.project.root)
        os._exit(_HANGUP)

    # The project

    def read_project(self) -> None:
        """Look at the project's files, beside the interface."""
        root = self.project.root

        def read() -> None:
            try:
                project = read_project(root)
                self.choice.features = features_of_models(project.of("model"))
                self.soon(self._project_read, project, ", ".join(other_sensors(project)), *later_screens())
            except LidarcheckError as error:
                self.soon(self.say, error)
            except Exception as error:  # noqa: BLE001 - else the interface would say for ever that it reads
                words = f"error: internal error in reading the project, {type(error).__name__}: {error}"
                self.soon(lambda: self.say(words, bad=True))

        threading.Thread(target=read, name="project", daemon=True).start()

    async def _project_read(self, project: Project, sensor: str, *later: type[View]) -> None:
        self.project, self.bars.sensor = project, sensor
        with self.batch_update():  # each would have the screen that is seen sent again
            for kind in later:
                if not any(isinstance(view, kind) for view in self._views):
                    view = kind()
                    self._views = (*self._views, view)
                    await self._switcher.add_content(view, id=view.NAME)
        for entry in project.faults:
            self.note(entry.fault, True)
        cut = "; there are more, which are not looked at" if project.cut else ""
        self.say((project.in_words() or "nothing here that lidarcheck knows: see ?") + cut)
        self.files_changed()
        self.numbers.project_read(project)
        self._numbers_changed()
        if self._awaited:
            self.show_screen(self._awaited)
        if self.numbers.engine.on:
            self.session.worker.start()  # it compiles, or loads, what the first number needs
        self.commands.look_back()
        self.reads += 1

    def inside(self, text: str) -> str:
        """A text without the project's own path in front of its files."""
        return self.project.inside(text)

    # Screens and bars

    def views(self) -> tuple[View, ...]:
        """All screens."""
        return self._views

    def _editors(self) -> list[Editor[Any]]:
        """All that may have files open."""
        return [*(editor for view in self.views() for editor in view.editors()), *self.commands.models.editors()]

    def _view_of(self, name: str) -> Any:
        """A screen by its name, once the project was read."""
        return next(view for view in self.views() if name == view.NAME)

    @property
    def view(self) -> View:
        """The screen that is seen."""
        name = self._switcher.current
        return next(view for view in self.views() if name == view.NAME)

    def show_screen(self, name: str) -> None:
        """Go to a screen, as soon as it is there."""
        self._awaited = "" if any(name == view.NAME for view in self._views) else name
        if self._awaited:
            self.say("reading the project ...")
            return
        self._switcher.current = name
        self.state.screen = name
        self.view.opened()
        # At once: `focus()` waits for a turn, and keys that came in one go with this one would act on the old screen.
        self.screen.set_focus(self.view.panes()[0])
        self._bars()

    def _bars(self) -> None:
        self.bars.show(self.view.NAME, self.project, self._columns or self.size.width)
        self.show_context()
        self._show_keys()

    def _show_keys(self) -> None:
        """The last line is that of the pane that has the focus; where one has the whole screen, it is that one."""
        if self.view.zoomed not in (None, self.focused) and self.focused in self.view.panes():
            self.view.zoom(self.focused)
        self.bars.show_keys(self.able(), self._columns or self.size.width)

    def progress(self, text: str, screen: str) -> None:
        """What a run of a screen says while it runs; empty when it has ended."""
        self.bars.progress(text, screen)

    def _wait(self, why: str) -> None:
        self.bars.wait(why)

    def say(self, text: str | LidarcheckError, *, bad: bool = False) -> None:
        """One line for the user, which the log keeps."""
        self.bars.say(text, self.project, bad)

    def note(self, text: str, bad: bool) -> None:
        """A line for the log alone."""
        self.bars.note(self.inside(text), bad)

    def action_help_quit(self) -> None:
        """Ctrl+C is no way out of an editor."""
        self.say("q leaves")

    async def action_quit(self) -> None:
        """Textual's own way out is ours."""
        self.action_leave()

    def action_leave(self) -> None:
        """Leave; edits are in the journal."""
        unsaved = sum(view.unsaved() for view in self.views()) + self.commands.models.unsaved()
        if not unsaved:
            self._leave("q")
            return
        words = [line("They are kept in the journal, and offered again at the next start.")]
        self.ask(Ask(f"{counted(unsaved, 'row')} not saved", words, {"q": "leave"}), self._leave)

    def _leave(self, key: str | None) -> None:
        if key == "q":
            self.exit(0, message="\n".join(filter(None, (view.waited_for() for view in self.views()))) or None)

    def on_unmount(self) -> None:
        """Keep the state, let workers end."""
        logging.getLogger("lidarcheck").removeHandler(self._warnings)
        self.session.close()
        for view in self.views():
            view.closing()
        self.commands.closing()
        save_state(self.state, self.project.root)

    def action_draw_again(self) -> None:
        """Send the whole screen."""
        self._forget_terminal()
        self.screen.refresh()

    def _forget_terminal(self) -> None:
        if callable(forget := getattr(self._driver, "forget", None)):
            forget()

    def on_resize(self, event: events.Resize) -> None:
        """Bars are cut to the new width."""
        self._forget_terminal()  # which may have moved or cut what it showed
        if event.size == self._last_size:
            self.screen.refresh()  # sizes in between that nobody saw here may have as well
        self._last_size = event.size
        if self.bars.top.is_mounted:
            self._columns = event.size.width
            self._bars()
            self.overlay.draw()


def run(root: Path, *, theme: str = "", screen: str = "", marks: str = "", mouse: bool = True) -> int:
    """Run the interface on a project until the user leaves; the exit code."""
    from lidarcheck.tui.driver import TerminalDriver

    # What starts processes keeps the terminal's stderr, which Textual takes away for as long as it runs.
    resource_tracker.ensure_running()
    app = LidarcheckApp(root, theme=theme, screen=screen, marks=marks, worker=Worker(), driver=TerminalDriver)
    code = app.run(mouse=mouse)
    return app.return_code or 0 if code is None else code
