"""A screen of pages whose jobs are quick and do as they are told, for tests of what all such screens share."""

import threading

import numpy as np
from textual.binding import Binding

from lidarcheck.errors import InputError
from lidarcheck.figures.data import Cloud, Distribution, Page, Section, Table
from lidarcheck.tui import actions, app
from lidarcheck.tui.actions import Action, page_actions
from lidarcheck.tui.jobs.job import Computed, Job
from lidarcheck.tui.screens.pages.lines import together
from lidarcheck.tui.screens.pages.screen import PageView
from lidarcheck.tui.screens.shared.view import MOVES

NAME = "fake"
ACTIONS: tuple[Action, ...] = page_actions(NAME, "vehicles compare", "real against simulated")
WIDE = ("distance [m]", *(f"a long column {number}" for number in range(8)))


def page_of(name: str) -> Page:
    values = np.linspace(1.0, 200.0, 60)
    figures = [
        Distribution(f"{name}, {feature}", feature, "", {"real": values, "simulated": 1.1 * values}, True)
        for feature in ("PEAK", "AREA", "WIDTH")
    ]
    cloud = Cloud("points", {"real": np.column_stack([values, values, values])})
    tables = (Table("Echoes", WIDE, (tuple(map(str, range(9))),), right=WIDE),)
    sections = (Section("All of them", ("Some words.",), tables, tuple(figures)), Section("Points", (), (), (cloud,)))
    return Page("Fakes", f"All is well with {name}.", sections, {"real": f"{name}.txt"})


def put_in(monkeypatch):
    """Have the app show the fake screen in the place of those that come later."""
    place = actions.Place("Fakes", "f9", "K", "Fake", "fakes", "vehicles compare", "real against simulated")
    monkeypatch.setitem(actions.SCREENS, NAME, place)
    monkeypatch.setattr(actions, "ACTIONS", (*actions.ACTIONS, *ACTIONS))
    monkeypatch.setattr(app, "later_screens", lambda: [FakeView])


class FakeView(PageView):
    """`gate`: what a job waits for; `runs`: how often each was computed."""

    NAME = NAME
    EMPTY = "no fake here: files that are called fake.txt"
    BINDINGS = [*MOVES, *(Binding(key, a.method) for a in ACTIONS if a.method for key in a.keys)]  # noqa: RUF012

    def __init__(self) -> None:
        super().__init__()
        self.gate = threading.Event()
        self.gate.set()
        self.begun = threading.Event()
        self.runs: dict[str, int] = {}
        self.together = 1

    def jobs(self):
        root = self.host.project.root
        found = [
            Job(name, f"what {name} is", (root / f"{name}.txt",), self.work(name), notes=notes)
            for name, notes in (("one", ()), ("two", ("two_b.txt: left out",)), ("bad", ()), ("worse", ()))
            if (root / f"{name}.txt").exists()
        ]
        return [*found, Job("cannot", "", (), self.work("cannot"), fault="there is no model")] if found else []

    def groups(self, page):
        return together(page.figures(), self.together)

    def work(self, name):
        def compute(on_progress):
            self.runs[name] = self.runs.get(name, 0) + 1
            self.begun.set()
            for step in range(3):
                on_progress(step, 3, "working")
                self.gate.wait(60.0)
            if name == "bad":
                raise InputError("holds no echoes", file=self.host.project.root / "bad.txt", fix="measure again")
            if name == "worse":
                raise ZeroDivisionError("by nothing")
            return Computed(page_of(name), {"echoes": 7})

        return compute
