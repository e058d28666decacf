"""Histograms: vehicles at their distances, real against simulated. As points Cloud shows them."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from textual import events
from textual.app import ComposeResult

from lidarcheck.session.model_choice import free_models
from lidarcheck.session.project import Entry
from lidarcheck.tui.chooser import Opening
from lidarcheck.tui.jobs.job import Computed, Job
from lidarcheck.tui.jobs.vehicles import Group, groups_of, job_of, options_of, source_of
from lidarcheck.tui.screens.pages.export import file_name
from lidarcheck.tui.screens.pages.lines import together
from lidarcheck.tui.screens.pages.screen import PageView
from lidarcheck.tui.screens.shared.view import MOVES, bindings
from lidarcheck.tui.screens.vehicle_numbers import number_lines
from lidarcheck.tui.widgets.lines import Line, Lines

if TYPE_CHECKING:
    from lidarcheck.calibration.vehicles.compare import AtDistance, VehicleComparison
    from lidarcheck.figures.data import Figure, Page
    from lidarcheck.figures.files.result_folder import Writer

__all__ = ["Histograms"]

_AT_ONCE = 3
_ACROSS_FROM = 120
"""Columns from which on a distance's features stand side by side."""
_NUMBERS_FROM = 18
"""Rows of the screen from which on there are numbers below a plot."""


class Histograms(PageView):
    """The vehicles of a project, and the histograms of one at all its distances."""

    NAME = "histograms"
    OPENS: ClassVar[dict[str, str]] = {"jobs": "@"}
    EMPTY = (
        "no vehicle was measured here: that takes scans with car, van or truck in their names, as car_20m_real.txt, "
        "and for each a simulated scan, car_20m_sim.txt, or an ideal one, car_20m_ideal.txt, and a model"
    )
    WORDS: ClassVar[dict[str, str]] = {
        "jobs": "The vehicles that were measured, by kind and variant as their names say. r compares all distances of "
        "one: with the simulated files, or with what a model makes of the ideal scans; o chooses. What is left out "
        "stands in the panes below.",
        "figures": "PEAK, AREA and WIDTH on log scales: real filled, simulated an outline, as shares; below, their "
        "ratio, o where chance allows it and ! where not. From 120 columns on the three are side by side, a row a "
        "distance; n and p go on to other distances and features, then to the points. b goes to Cloud, which shows "
        "both vehicles beside each other, lays one over the other and writes both as one cloud.",
        "numbers": "How far real and simulated are apart at the distance that is seen: each feature's part of the "
        "number now, before the last step and at the start, where there is one; the Kolmogorov-Smirnov distance, what "
        "it passes by chance in one case of twenty, and in words.",
        "words": "The numbers of all distances, and how each vehicle was found.",
    }
    BINDINGS: ClassVar[list[Any]] = [*bindings("histograms"), *MOVES]
    DEFAULT_CSS = """
    Histograms #numbers { height: 4; }
    Histograms.wide #words { dock: bottom; width: 1fr; height: 16; }
    """

    def __init__(self) -> None:
        super().__init__()
        self._vehicles: list[Group] = []

    def jobs(self) -> list[Job]:
        """A job for each vehicle and variant, those that can be computed first."""
        groups = groups_of(self.host.project)
        found = [(group, job_of(group, self._source(group), self._models(group))) for group in groups]
        found.sort(key=lambda pair: bool(pair[1].fault))
        self._vehicles = [group for group, _ in found]
        return [job for _, job in found]

    def _source(self, group: Group) -> str:
        """What a group is compared with: as chosen, else the likeliest."""
        return source_of(group, self._models(group), self.host.choice.of("model"))

    def _models(self, group: Group) -> list[Entry]:
        """The models that a group may be simulated with."""
        return free_models(self.host.project, group.measurements[0].path.parent)

    def compose(self) -> ComposeResult:
        """Below the plots, where there is room for one of them, the numbers of all features."""
        yield from super().compose()
        yield Lines("Numbers", label="n", id="numbers")

    def on_resize(self, event: events.Resize) -> None:
        """One plot and numbers, or features side by side. The base's own is called besides, by Textual."""
        self.set_class(event.size.width < _ACROSS_FROM and event.size.height >= _NUMBERS_FROM, "one")

    def _draw_page(self) -> None:
        """The numbers as well."""
        super()._draw_page()
        self._draw_numbers()

    def _draw_numbers(self) -> None:
        pane, page = self.query_one("#numbers", Lines), self.page
        shown = [] if page is None or not self.has_class("one") else self.shown(page)[1]
        title, lines = self._numbers_of(shown[0][0]) if shown else ("Numbers", [])
        pane.display = bool(lines)
        pane.show(lines, title=title, state=self.state if lines else "")

    def _numbers_of(self, figure: Figure) -> tuple[str, list[Line]]:
        """A title and a line for each feature at the distance of a histogram."""
        from lidarcheck.figures.data import Distribution

        at = next((one for one in self.result if _at_words(one.distance_m) in figure.title), None)
        if at is None or not isinstance(figure, Distribution):
            return "Numbers", []
        own = self._measured_at(at)
        return number_lines(at, figure.quantity, None if own is None else self.host.numbers.of_file(own))

    def _measured_at(self, at: AtDistance) -> Path | None:
        """The file that was measured at a distance of the vehicle."""
        measured = self._vehicles[self.at].measurements if self._vehicles else ()
        near = [(abs(one.distance_m - at.distance_m), one.path) for one in measured if one.distance_m is not None]
        return min(near)[1] if near else None

    def numbers_changed(self) -> None:
        """A part of them stands below the plot."""
        if self.is_chosen and self.has_class("one"):
            self._draw_numbers()

    def groups(self, page: Page) -> list[tuple[Figure, ...]]:
        """A distance's features side by side, so many distances below each other as can be read; where there is no
        room for that one large plot at a time, feature after feature, and the numbers of all. Then the points.
        """
        from lidarcheck.figures.data import Distribution

        bars = [figure for figure in page.figures() if isinstance(figure, Distribution)]
        others = [(figure,) for figure in page.figures() if not isinstance(figure, Distribution)]
        names = list(dict.fromkeys(figure.quantity for figure in bars))
        self.board.across = max(len(names), 1)
        if self.board.beside == len(names) and self.size.width >= _ACROSS_FROM:
            down = max(self.board.room(len(names) * _AT_ONCE) // len(names), 1)
            return [*together(bars, len(names) * down), *others]
        return [*((figure,) for name in names for figure in bars if figure.quantity == name), *others]

    @property
    def result(self) -> tuple[AtDistance, ...]:
        """All distances of what is shown; empty before they are computed."""
        made = self.made
        comparison: VehicleComparison | None = None if made is None else made.result
        return () if comparison is None else comparison.distances

    def action_beside(self) -> None:
        """Both vehicles beside each other."""
        self.host.show_screen("cloud")

    def action_turn(self, by: int) -> None:
        """Other figures, or another distance."""
        super().action_turn(by)
        self._choose_seen()

    # The distance that all screens look at

    def measured_files(self, number: int) -> tuple[Path, ...]:
        """The vehicle's measurements, also those that are left out."""
        return tuple(one.path for one in self._vehicles[number].measurements)

    def follow(self) -> None:
        """Go to the vehicle and the distance that were chosen."""
        super().follow()
        page, chosen = self.page, self.host.choice.measured(self.host.project)
        measured = self._vehicles[self.at].measurements if self._vehicles else ()
        wanted_m = next((one.distance_m for one in measured if one.path == chosen), None)
        if page is None or wanted_m is None:
            return
        distances = [at.distance_m for at in self.result]
        if not distances:
            return
        groups, words = self.groups(page), _at_words(min(distances, key=lambda at_m: abs(at_m - wanted_m)))
        there = [number for number, figures in enumerate(groups) if any(words in figure.title for figure in figures)]
        if there and self.turned not in there:
            self.turned = there[0]

    def _choose_seen(self) -> None:
        """The distance that is seen now is the one that all screens look at."""
        page = self.page
        if page is None or not self._vehicles or not self.result:
            return
        titles = [figure.title for figure, _ in self.shown(page)[1]]
        for at in self.result:
            if any(_at_words(at.distance_m) in title for title in titles):
                own = self._measured_at(at)
                if own is not None:
                    self.host.choice.choose_measured(own, self.host.project)
                return

    # Choices and files

    def action_next_source(self) -> None:
        """Compare with the simulated files, or with the next model."""
        group = self._vehicles[self.at] if self._vehicles else None
        options = [] if group is None else options_of(group, self._models(group))
        if group is None or not options:
            self.say("there is nothing to compare with: neither simulated files, nor ideal scans and a model")
            return
        source = self._source(group)
        now = options.index(source) if source in options else -1
        chosen = options[(now + 1) % len(options)]
        self.host.choice.choose("model", chosen)
        self.say(f"{group.name}: {chosen} ({(now + 1) % len(options) + 1} of {len(options)})")
        self.project_changed()

    def openings(self) -> list[Opening]:
        """What the vehicles can be compared with that is no model."""
        files = {one for group in self._vehicles for one in options_of(group, [])}
        return [Opening("source", name, "of vehicles", partial(self._compare_with, name)) for name in sorted(files)]

    def _compare_with(self, source: str) -> None:
        self.host.choice.choose("model", source)
        self.host.show_screen(self.NAME)
        self.project_changed()

    def action_next_distance(self, by: int) -> None:
        """The distances are on the page."""
        self.action_turn(by)

    def action_write_sheet(self) -> None:
        """The histograms of all distances as a picture."""
        job, made = self.job, self.made
        if job is None or made is None:
            self.say("r computes it first")
            return
        write = partial(_write_sheet, made.result, self.kind_of.get("histogram", "histogram"))
        title = "Write the histograms of all distances to which PNG file?"
        self.exports.ask_file(title, f"{file_name(job.name)}_distances.png", write, job)

    def more_files(self, made: Computed, kind: str) -> Mapping[str, Writer]:
        """The sheet, as the command."""
        from lidarcheck.figures.files.vehicle_sheet import SHEET

        return {SHEET: partial(_write_sheet, made.result, kind)}


def _at_words(distance_m: float) -> str:
    """How the titles of figures say a distance."""
    return f" at {distance_m:.0f} m, "


def _write_sheet(result: VehicleComparison, kind: str, path: Path) -> str:
    from lidarcheck.figures.files.vehicle_sheet import save_distances

    save_distances(result, path, kind)
    return f"{path.name}: all distances"
