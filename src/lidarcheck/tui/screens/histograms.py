"""Histograms: vehicles at their distances, real against simulated, and both beside each other."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from textual import events
from textual.app import ComposeResult

from lidarcheck.tui.chooser import Opening
from lidarcheck.tui.jobs.job import Computed, Job
from lidarcheck.tui.jobs.vehicles import Group, groups_of, job_of, options_of, source_of
from lidarcheck.tui.screens.pages.export import file_name
from lidarcheck.tui.screens.pages.lines import together
from lidarcheck.tui.screens.pages.screen import PageView
from lidarcheck.tui.screens.shared.view import MOVES, bindings
from lidarcheck.tui.widgets.lines import Line, Lines, line

if TYPE_CHECKING:
    from lidarcheck.calibration.vehicles.compare import AtDistance, VehicleComparison
    from lidarcheck.calibration.vehicles.merge import Placed
    from lidarcheck.figures.data import Figure, Page
    from lidarcheck.figures.files.result_folder import Writer

__all__ = ["Histograms"]

_AT_ONCE, _STEP_M = 3, 0.25
_ACROSS_FROM = 120
"""Columns from which on a distance's features stand side by side."""
_NUMBERS_FROM = 18
"""Rows of the screen from which on there are numbers below a plot."""


class Histograms(PageView):
    """`side_by_side`: both vehicles are seen in the place of the histograms, those of the distance number `distance`.

    `offsets`: what was set by hand, by vehicle and distance.
    """

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
        "distance; n and p go on to other distances and features, then to the points. b shows both vehicles beside "
        "each other, the centroids laid onto each other and moved apart: + and - move the simulated one to the left "
        "and to the right, ] and [ forward and backward, and the menu (m) has what "
        "lays them as suggested and writes both as one cloud.",
        "numbers": "How far real and simulated are apart at the distance that is seen: the Kolmogorov-Smirnov "
        "distance, what it passes by chance in one case of twenty, and in words.",
        "words": "The numbers of all distances, and how each vehicle was found.",
    }
    BINDINGS: ClassVar[list[Any]] = [*bindings("histograms"), *MOVES]
    DEFAULT_CSS = """
    Histograms #numbers { height: 4; }
    Histograms.wide #words { dock: bottom; width: 1fr; height: 16; }
    """

    def __init__(self) -> None:
        super().__init__()
        self.side_by_side = False
        self.distance = 0
        self.offsets: dict[tuple[str, int], tuple[float, float]] = {}
        self._vehicles: list[Group] = []

    def jobs(self) -> list[Job]:
        """A job for each vehicle and variant, those that can be computed first."""
        project = self.host.project
        models = project.of("model")
        found = [(group, job_of(group, self._source(group), models)) for group in groups_of(project)]
        found.sort(key=lambda pair: bool(pair[1].fault))
        self._vehicles = [group for group, _ in found]
        return [job for _, job in found]

    def _source(self, group: Group) -> str:
        """What a group is compared with: as chosen, else the likeliest."""
        return source_of(group, self.host.project.of("model"), self.host.choice.of("model"))

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
        pane, page = self.query_one("#numbers", Lines), self.page
        shown = [] if page is None or not self.has_class("one") else self.shown(page)[1]
        title, lines = number_lines(self.result, shown[0][0] if shown else None)
        pane.display = bool(lines)
        pane.show(lines, title=title, state=self.state if lines else "")

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

    def shown(self, page: Page) -> tuple[str, list[tuple[Figure, str]]]:
        """The histograms, or both vehicles from above and from the side."""
        found = self._beside_now()
        if found is None:
            return super().shown(page)
        from lidarcheck.figures.data import Cloud

        at, placed = found
        cloud = Cloud(self._at_words(at), {"real": at.cuts[0].xyz_m, "simulated": placed.moved_m})
        return "", [(cloud, "top"), (cloud, "side")]

    # Both beside each other

    @property
    def result(self) -> tuple[AtDistance, ...]:
        """All distances of what is shown; empty before they are computed."""
        made = self.made
        comparison: VehicleComparison | None = None if made is None else made.result
        return () if comparison is None else comparison.distances

    def _at_words(self, at: AtDistance) -> str:
        return f"{self.job.name if self.job else ''} at {at.distance_m:.0f} m"

    def _beside_now(self) -> tuple[AtDistance, Placed] | None:
        """The distance that is seen and where its simulated vehicle stands; None while histograms are seen."""
        from lidarcheck.calibration.vehicles.kinds import vehicle_named
        from lidarcheck.calibration.vehicles.merge import place_vehicles

        made, job = self.made, self.job
        if not self.side_by_side or made is None or job is None or not self.result:
            return None
        self.distance %= len(self.result)
        at = self.result[self.distance]
        x, y = self.offsets.get((job.name, self.distance), (None, None))
        return at, place_vehicles(*at.cuts, vehicle_named(made.result.vehicle), x_m=x, y_m=y)

    def _looked_at(self) -> tuple[AtDistance, Placed] | None:
        """The same, or a word to the user."""
        found = self._beside_now()
        if found is None:
            self.say("b shows both vehicles beside each other first" if self.result else "r computes it first")
        return found

    def action_beside(self) -> None:
        """Both vehicles beside each other, or the histograms again."""
        if not self.result:
            self.say("r computes it first")
            return
        self.side_by_side = not self.side_by_side
        self._say_place()
        self.draw()

    def _say_place(self) -> None:
        """Where the simulated vehicle is beside the real one."""
        found = self._beside_now()
        if found is not None:
            (x, y), (_, suggested) = found[1].offset_m, found[1].suggested_m
            at = f"{self.distance + 1} of {len(self.result)}"
            self.say(f"X {x:g} m, Y {y:g} m (suggested 0 and {suggested:g}), {at}")

    def action_turn(self, by: int) -> None:
        """Other figures, or another distance."""
        if self._beside_now() is None:
            super().action_turn(by)
        else:
            self.distance += by
            self._say_place()
            self.draw()
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
        self.distance = min(range(len(distances)), key=lambda at: abs(distances[at] - wanted_m))
        groups, words = self.groups(page), _at_words(distances[self.distance])
        there = [number for number, figures in enumerate(groups) if any(words in figure.title for figure in figures)]
        if there and self.turned not in there:
            self.turned = there[0]

    def _choose_seen(self) -> None:
        """The distance that is seen now is the one that all screens look at."""
        page = self.page
        if page is None or not self._vehicles or not self.result:
            return
        measured = self._vehicles[self.at].measurements
        titles = [figure.title for figure, _ in self.shown(page)[1]]
        beside = self.result[self.distance].distance_m if self.side_by_side else None
        for at in self.result:
            if at.distance_m == beside or any(_at_words(at.distance_m) in title for title in titles):
                near = [(abs(m.distance_m - at.distance_m), m) for m in measured if m.distance_m is not None]
                if near:
                    self.host.choice.choose_measured(min(near, key=lambda one: one[0])[1].path, self.host.project)
                return

    def action_kind(self) -> None:
        """Another kind of picture; the vehicles are seen from above and from the side at once."""
        if self._beside_now() is None:
            super().action_kind()
        else:
            self.say("seen from above and from the side")

    def action_nudge(self, forward: int, left: int) -> None:
        """Move the simulated vehicle."""
        found = self._looked_at()
        if found is not None and self.job is not None:
            x, y = found[1].offset_m
            moved = (round(x + forward * _STEP_M, 6), round(y + left * _STEP_M, 6))
            self.offsets[self.job.name, self.distance] = moved
            self._say_place()
            self.draw()

    def action_suggested(self) -> None:
        """The offset that the vehicle's size suggests."""
        if self._looked_at() is not None and self.job is not None:
            self.offsets.pop((self.job.name, self.distance), None)
            self._say_place()
            self.draw()

    # Choices and files

    def action_next_source(self) -> None:
        """Compare with the simulated files, or with the next model."""
        group = self._vehicles[self.at] if self._vehicles else None
        options = [] if group is None else options_of(group, self.host.project.of("model"))
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

    def action_write_cloud(self) -> None:
        """Both vehicles as one cloud, as `vehicles merge` writes them."""
        found, job, made = self._looked_at(), self.job, self.made
        if found is not None and job is not None and made is not None:
            at, placed = found
            name = f"{file_name(job.name)}_{at.distance_m:.0f}m_merged.pcd"
            write = partial(_write_cloud, at, placed.offset_m, made.result.vehicle)
            self.exports.ask_file("Write both vehicles, as one cloud, to which file?", name, write, job)

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


def number_lines(distances: Sequence[AtDistance], figure: Figure | None) -> tuple[str, list[Line]]:
    """A title and a line for each feature at the distance of a histogram: how far real and simulated are apart."""
    from lidarcheck.figures.data import Distribution

    if not isinstance(figure, Distribution):
        return "Numbers", []
    at = next((one for one in distances if _at_words(one.distance_m) in figure.title), None)
    if at is None:
        return "Numbers", []
    lines: list[Line] = []
    for name, gap in at.features.items():
        chance = at.ks_chance[name]
        off = 100.0 * (gap.mean_simulated / gap.mean_measured - 1.0) if gap.mean_measured else math.nan
        apart = "within chance" if gap.ks <= chance else f"mean {off:+.1f} %, more than by chance"
        pointer = ">" if name == figure.quantity else " "
        words = f"{pointer}{name:9}{gap.ks:7.3f}{chance:10.3f}  {apart}"
        lines.append(line(words, "text" if gap.ks <= chance else "edited"))
    return f"{at.distance_m:.0f} m      KS  by chance", lines


def _write_sheet(result: VehicleComparison, kind: str, path: Path) -> str:
    from lidarcheck.figures.files.vehicle_sheet import save_distances

    save_distances(result, path, kind)
    return f"{path.name}: all distances"


def _write_cloud(at: AtDistance, offset_m: tuple[float, float], vehicle: str, path: Path) -> str:
    from lidarcheck.calibration.vehicles.kinds import vehicle_named
    from lidarcheck.calibration.vehicles.merge import merge_vehicles
    from lidarcheck.formats.recognise import target_format, write_table

    target_format(path)
    names = ("the real scan", "the simulated scan")
    merged = merge_vehicles(*at.cuts, vehicle_named(vehicle), x_m=offset_m[0], y_m=offset_m[1], files=names)
    write_table(merged.columns, path)
    return f"{path.name}: {merged.n_real + merged.n_simulated} points, Simulated is 0 for the real ones"
