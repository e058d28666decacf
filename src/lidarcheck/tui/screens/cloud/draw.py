"""What Cloud shows of a measurement, and its panes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from lidarcheck.arrays import FloatArray
from lidarcheck.session.pairing import is_simulated, labels_of, partner_of
from lidarcheck.session.project import Entry
from lidarcheck.tui.jobs.beside import Beside
from lidarcheck.tui.jobs.clouds import Clouds, Source, cloud_job
from lidarcheck.tui.jobs.job import Job
from lidarcheck.tui.screens.cloud.density import BELOW, LEFT
from lidarcheck.tui.screens.cloud.lens import Lens
from lidarcheck.tui.screens.cloud.merged import Offset, merged_name, placed
from lidarcheck.tui.screens.cloud.panes import Points, Seen, View, difference_lines, points_of, views_of
from lidarcheck.tui.screens.pages.lines import no_page_lines
from lidarcheck.tui.screens.scenes import Scenes
from lidarcheck.tui.widgets.lines import Line, Lines, line, wrapped

if TYPE_CHECKING:
    from lidarcheck.calibration.vehicles.merge import Placed

__all__ = ["PANES", "CloudPanes"]

PANES = ("real", "simulated", "real2", "simulated2")
"""Both sides of the view that is seen, and of a second one where there is room."""
_SECOND = {"above": "behind", "behind": "side", "side": "above"}


class CloudPanes(Scenes):
    """`maps`: the page of the comparison is seen; `over`: both sides lie over each other.

    `offsets`: of the simulated vehicle in the merged cloud, by measurement.
    """

    def __init__(self) -> None:
        super().__init__()
        self.maps, self.over = False, False
        self.offsets: dict[str, tuple[float, float]] = {}
        self.at_view = 0
        self.lens = Lens()
        self._kept: tuple[object, Placed | None] | None = None
        self._kept_job: tuple[list[Job], int, Job | None] | None = None
        self._kept_points: tuple[Clouds, dict[object, Points]] | None = None

    @property
    def measured(self) -> str:
        """The name of the measurement under the cursor."""
        return "" if self.job is None else self.job.name

    # What is looked at

    def _source(self, scan: Entry) -> Source:
        """What stands beside a frame: a simulated file, else what the model makes of its ideal scan, or why neither."""
        project = self.host.project
        models = tuple(entry.path for entry in project.of("model"))
        simulated = partner_of(scan, [entry for entry in project.of("scan") if is_simulated(entry)])
        own = self.beside.get(scan.path.resolve(), Beside(None))
        ideal = own.ideal
        if simulated is not None and not self._is_model_chosen():
            return Source(simulated, ideal, None, self._effects(None), "", models, own.placement)
        model = self._model(scan)
        lacking = next((job.fault for job in self.listed if job.name == scan.name), "")
        if ideal is None or model is None:
            return Source(
                None, ideal, None, self._effects(None), lacking or "there is nothing to simulate", models, own.placement
            )
        return Source(None, ideal, model.path, self._effects(model), "", models, own.placement)

    def _is_model_chosen(self) -> bool:
        """Whether a model was chosen by hand, which goes before simulated files."""
        wanted = self.host.choice.of("model")
        return any(wanted == entry.name for entry in self.host.project.of("model"))

    def _variant_here(self) -> str:
        scan = self._scan()
        return "" if scan is None else labels_of(scan).variant

    @property
    def cloud(self) -> Job | None:
        """What the clouds of the measurement under the cursor are computed by."""
        kept = self._kept_job
        if kept is None or kept[0] is not self.listed or kept[1] != self.at:
            scan = self._scan()
            job = None if scan is None else cloud_job(scan, self._source(scan))
            self._kept_job = kept = (self.listed, self.at, job)  # listed anew after any choice
        return kept[2]

    @property
    def clouds(self) -> Clouds | None:
        """The clouds that are known of it; they may be old."""
        job = self.cloud
        made = None if job is None else self.known(job)[1]
        return None if made is None else made.result

    @property
    def view_now(self) -> View:
        """The view that is seen, of those that there are."""
        views = views_of(self.clouds)
        return views[self.at_view % len(views)]

    @property
    def is_over(self) -> bool:
        """Whether both sides are in one pane: a merged cloud is one."""
        return self.over or (self.view_now.merged and not self.maps)

    # Drawing

    def draw(self) -> None:
        """The list and the page, or the clouds."""
        super().draw()
        self.draw_clouds()

    def draw_clouds(self) -> None:
        """The points of both sides, and where they differ."""
        if self.maps or not self.size.width:
            return
        job, clouds = self.cloud, self.clouds
        if job is None or clouds is None:
            self._draw_none(job)
            return
        state = self.known(job)[0]
        view = self.view_now
        self._draw_view(clouds, view, ("real", "simulated"), state, first=True)
        if self.has_class("tall"):
            second = View(view.frame, _SECOND[view.side], view.merged)
            self._draw_view(clouds, second, ("real2", "simulated2"), state, first=False)

    def _draw_none(self, job: Job | None) -> None:
        """Nothing is known yet."""
        for name in (*PANES, "where"):
            pane = self.query_one(f"#{name}", Lines)
            width = (pane.size.width or self.size.width) - 1
            if job is None:
                lines = wrapped(self.EMPTY, width, "dim") if name == "real" else []
            else:
                shown = no_page_lines(job, self.is_computing(job), self.fault_of(job), width)
                lines = shown if name in ("real", "real2") else []
            state = "" if job is None else self.known(job)[0]
            pane.show(lines, title=self._title(name), state=state)

    @staticmethod
    def _title(name: str) -> str:
        return "Where they differ" if name == "where" else "Real" if name.startswith("real") else "Simulated"

    def _draw_view(self, clouds: Clouds, view: View, names: tuple[str, str], state: str, *, first: bool) -> None:
        real, simulated = (self.query_one(f"#{name}", Lines) for name in names)
        points, seen = self._seen(clouds, view, real)
        cursor = self.lens.cursor(self.measured, view, seen)
        over = self.is_over and points.simulated_m is not None
        moved = self._moved_words(clouds) if view.merged else ""
        title = f"{'Both' if over else 'Real'} {len(points.real_m)}, {view.words}{moved}"
        title += f"  {self.measured}" if first else ""
        real.show(seen.lines("over" if over else "real", cursor), title=title, state=state)
        if points.simulated_m is None:
            words = wrapped(f"none: {self.host.inside(clouds.lacking)}", simulated.size.width - 1, "bad")
            simulated.show(words, title="Simulated", state="none")
        elif not over:
            title = f"Simulated {len(points.simulated_m)}, {view.words}"
            simulated.show(seen.lines("simulated", cursor), title=title, state=state)
        if first:
            self._draw_where(clouds, seen, view, state)

    def _seen(self, clouds: Clouds, view: View, pane: Lines) -> tuple[Points, Seen]:
        size = max(pane.size.width - LEFT - 1, 1), max(pane.rows - BELOW, 1)
        points = self._points(clouds, view)
        return points, self.lens.seen(self.measured, view, points, size)

    def _points(self, clouds: Clouds, view: View, *, moved: bool = True) -> Points:
        """The points of a view; kept while nothing has changed, since they are drawn at every key."""
        key = (view.frame, view.merged and moved, self._offset())
        if self._kept_points is None or self._kept_points[0] is not clouds:
            self._kept_points = clouds, {}
        kept = self._kept_points[1]
        if key not in kept:
            kept[key] = points_of(clouds, view, self._moved_m(clouds) if view.merged and moved else None)
        return kept[key]

    def _draw_where(self, clouds: Clouds, seen: Seen, view: View, state: str) -> None:
        pane = self.query_one("#where", Lines)
        lines: list[Line] = [line(self._readout(seen, view), "title")]
        why = f"none: {self.host.inside(clouds.lacking)}"
        lines += difference_lines(
            self._points(clouds, view, moved=False), why, max(pane.size.width - 1, 20), pane.rows - 2
        )
        lines.append(line(f" {self._file_words(clouds)}", "dim"))
        pane.show(lines, title=f"{'Where they differ':<22} {'real':>9} {'simulated':>11}", state=state)

    def _readout(self, seen: Seen, view: View) -> str:
        at = self.lens.cursor_m(self.measured, view)
        legend = seen.legend(self.is_over)
        if at is None:
            return f" {legend}"
        x, y = seen.side.names
        real, simulated = seen.at(seen.window.cell(at, seen.size))
        shown = "" if simulated is None else f", simulated {simulated}"
        return f" {x} {seen.side.sign * at[0]:.2f} {y} {at[1]:.2f}: real {real}{shown} echoes   {legend}"

    def _file_words(self, clouds: Clouds) -> str:
        if clouds.simulated is None:
            return ""
        if clouds.at is None:
            return f"the whole frame: {self.host.inside(clouds.no_vehicle)}"
        both = sum(len(cut.scan) for cut in clouds.at.cuts)
        return f"w writes {merged_name(clouds, self.measured, self._variant_here())}: {both} points, column Simulated"

    # The merged cloud

    def _offset(self) -> Offset:
        return self.offsets.get(self.measured, (None, None))

    def _placed(self, clouds: Clouds) -> Placed | None:
        """Where the simulated vehicle stands; kept while nothing has changed."""
        key = (id(clouds), self._offset())
        if self._kept is None or self._kept[0] != key:
            self._kept = key, placed(clouds, self._offset())
        return self._kept[1]

    def _moved_m(self, clouds: Clouds) -> FloatArray | None:
        found = self._placed(clouds)
        return None if found is None else found.moved_m

    def _moved_words(self, clouds: Clouds) -> str:
        found = self._placed(clouds)
        if found is None:
            return ""
        x, y = found.offset_m
        return f", {f'X {x:g} ' if x else ''}Y {y:g} m"
