"""Cloud: what was measured beside what is simulated, as points: vehicles, whole frames, maps of where they disagree."""

from __future__ import annotations

from functools import partial
from typing import Any, ClassVar

from textual import events
from textual.app import ComposeResult
from textual.containers import Horizontal, Vertical

from lidarcheck.tui.jobs.clouds import Clouds
from lidarcheck.tui.screens.cloud.draw import PANES, CloudPanes
from lidarcheck.tui.screens.cloud.merged import merged_name, write_merged
from lidarcheck.tui.screens.cloud.panes import Seen, View, beams_at, views_of
from lidarcheck.tui.screens.scenes import Scenes
from lidarcheck.tui.screens.shared.view import MOVES, bindings
from lidarcheck.tui.widgets.lines import Lines

__all__ = ["Cloud"]

_STEP_M = 0.25
_TALL_FROM = 30
"""Rows from which on a second view is seen below the first one."""
_STEPS = {"up": (0, 1), "down": (0, -1), "pageup": (0, 5), "pagedown": (0, -5), "home": (-10, 0), "end": (10, 0)}
"""Columns and rows that a key moves the cursor by."""


class Cloud(CloudPanes):
    """Two views of a measurement, real left and simulated right, or the maps of its comparison."""

    NAME = "cloud"
    EMPTY = (
        "no frame was measured here: that takes scans, as real_street.pcd; and for each a simulated one, "
        "sim_street.pcd, or the ideal scan of the same frame, ideal_street.pcd, and a model"
    )
    WORDS: ClassVar[dict[str, str]] = {
        "real": "Echoes a cell of what was measured, left, and of what is simulated, right; both on one scale, with "
        "one zoom and one cursor. v goes on: the vehicle from above, from behind, from the side, in one cloud; the "
        "whole frame; the maps. + and - zoom about the cursor, 0 shows all, b lays one side over the other; n and "
        "p go to other measurements. w writes both as one cloud, Enter names the beams under the cursor.",
        "where": "Slices along X, Y and Z with their echoes, real and simulated, those that differ most first: by how "
        "many standard deviations of counted echoes. Echoes of neighbouring beams are alike, so 2 sd is a hint.",
        **Scenes.WORDS,
    }
    BINDINGS: ClassVar[list[Any]] = [*bindings("cloud"), *MOVES]
    DEFAULT_CSS = """
    Cloud #where { height: 5; }
    Cloud #lower { display: none; height: 3fr; }
    Cloud #upper { height: 4fr; }
    Cloud.tall #where { height: 7; }
    Cloud.tall #lower { display: block; }
    Cloud #maps { display: none; height: 1fr; }
    Cloud.maps #maps { display: block; }
    Cloud.maps #upper, Cloud.maps #lower, Cloud.maps #where { display: none; }
    Cloud.over #simulated, Cloud.over #simulated2 { display: none; }
    """

    def compose(self) -> ComposeResult:
        """Both sides, a second view of them, where they differ; or the page of the comparison."""
        with Horizontal(id="upper"):
            yield Lines("Real", label="a", id="real")
            yield Lines("Simulated", label="b", id="simulated")
        with Horizontal(id="lower"):
            yield Lines("Real", label="e", id="real2")
            yield Lines("Simulated", label="f", id="simulated2")
        yield Lines("Where they differ", label="d", id="where")
        with Vertical(id="maps"):
            yield from super().compose()

    def on_mount(self) -> None:
        """Points are counted for the room that there is."""
        super().on_mount()
        for name in (*PANES, "where"):
            self.query_one(f"#{name}", Lines).when_resized = self.draw_clouds

    def on_resize(self, event: events.Resize) -> None:
        """A second view where there is room for one."""
        super().on_resize(event)
        self.set_class(event.size.height >= _TALL_FROM, "tall")

    def panes(self) -> list[Lines]:
        """Those of what is seen."""
        if self.maps:
            maps = self.query_one("#maps", Vertical)
            return [pane for pane in super().panes() if maps in pane.ancestors]
        hidden = set() if self.has_class("tall") else {"real2", "simulated2"}
        hidden |= {"simulated", "simulated2"} if self.is_over else set()
        return [self.query_one(f"#{name}", Lines) for name in (*PANES, "where") if name not in hidden]

    def opened(self) -> None:
        """Show the measurement that is chosen; its clouds are computed by themselves."""
        super().opened()
        self.renew()

    def renew(self) -> None:
        """Compute the clouds that are seen when nothing is known of them, or again where that takes no longer than a
        moment; a comparison is computed again where it was asked for before.
        """
        if self.maps:
            super().renew()
            return
        job = self.cloud
        if job is None or job.fault or self.running is not None or not self.is_chosen:
            return
        word, derived = self.host.session.status(job.node)
        if word == "" or (word.startswith("OLD") and derived is not None and self.host.session.is_cheap(derived)):
            self._start(job)

    def action_compute(self) -> None:
        """Compute what is seen: the clouds, or the comparison."""
        self.compute(self.job if self.maps else self.cloud)

    # Window and cursor

    def _now(self) -> tuple[Clouds, View, Seen] | None:
        """What the keys of the clouds act on; None where there is nothing yet, which is said."""
        clouds = self.clouds
        if clouds is None or self.maps:
            self.say("no points are seen here; v goes on to them" if self.maps else "r computes it first")
            return None
        view = self.view_now
        return clouds, view, self._seen(clouds, view, self.query_one("#real", Lines))[1]

    def action_move(self, key: str) -> None:
        """The cursor; in the maps the list, in the pane of differences its lines."""
        where = self.query_one("#where", Lines)
        if self.maps:
            super().action_move(key)
        elif where.has_focus:
            where.scroll_by_key(key)
        else:
            self.action_across(*_STEPS[key])

    def action_across(self, columns: int, rows: int = 0) -> None:
        """Move the cursor by cells. In the maps: other figures."""
        if self.maps:
            super().action_turn(1 if columns > 0 else -1)
            return
        found = self._now()
        if found is not None:
            self.lens.move(self.measured, *found[1:], columns, rows)
            self.draw_clouds()

    def action_zoom(self, by: float) -> None:
        """Nearer or farther."""
        found = self._now()
        if found is not None:
            self.lens.zoom(self.measured, *found[1:], by)
            self.draw_clouds()

    def action_fit(self) -> None:
        """Show all again."""
        self.lens.fit(self.measured, self.view_now)
        self.draw_clouds()

    def action_beams(self) -> None:
        """Name the beams of the echoes under the cursor; in the maps compute the comparison."""
        if self.maps:
            self.compute(self.job)
            return
        found = self._now()
        if found is None:
            return
        clouds, view, seen = found
        cell = self.lens.cursor(self.measured, view, seen)
        if cell is None:
            self.say("the arrows set the cursor first")
            return
        scans = [clouds.real, clouds.simulated] if view.frame or clouds.at is None else [c.scan for c in clouds.at.cuts]
        words = [
            f"{name}: {beams_at(scan, (seen.window.cells(seen.side.places(xyz), seen.size) == cell).all(axis=1))}"
            for name, scan, xyz in zip(("real", "simulated"), scans, seen.points.sides, strict=False)
            if scan is not None
        ]
        self.say("; ".join(words))

    # Views and measurements

    def action_kind(self) -> None:
        """The next view; behind the last one the maps, and behind these the first view again."""
        views = views_of(self.clouds)
        if self.maps or self.at_view + 1 < len(views):
            self.at_view = 0 if self.maps else self.at_view + 1
            self.show_maps(False)
        else:
            self.show_maps(True)
        self.say("maps of where they disagree" if self.maps else f"seen: {self.view_now.words}")

    def show_maps(self, maps: bool) -> None:
        """The page of the comparison, or the clouds."""
        self.maps = maps
        self.set_class(maps, "maps")
        self.set_class(self.is_over, "over")
        self.panes()[0].focus()
        self.call_after_refresh(self.draw)

    def action_over(self) -> None:
        """One side over the other, or beside each other again."""
        self.over = not self.over
        self.show_maps(self.maps)

    def action_turn(self, by: int) -> None:
        """Another measurement."""
        if not self.listed:
            self.say("there is nothing to show here")
            return
        self.at = (self.at + by) % len(self.listed)
        self.turned = 0
        self.host.state.selected[self.NAME] = self.listed[self.at].name
        self.choose_measured()
        self.draw()
        self.renew()

    def choice_changed(self) -> None:
        """Another measurement, or another model."""
        super().choice_changed()
        self.renew()

    def project_changed(self) -> None:
        """The files may be others."""
        super().project_changed()
        if self.is_mounted:
            self.renew()

    # One cloud of both

    def action_nudge(self, forward: int, left: int) -> None:
        """Move the simulated vehicle in the merged cloud."""
        clouds = self.clouds
        found = None if clouds is None else self._placed(clouds)
        if found is None:
            self.say("no vehicle is seen here that could be moved")
            return
        x, y = found.offset_m
        moved = (round(x + forward * _STEP_M, 6), round(y + left * _STEP_M, 6))
        self.offsets[self.measured] = moved
        suggested = f"suggested {found.suggested_m[0]:g} and {found.suggested_m[1]:g}"
        self.say(f"in the merged cloud: X {moved[0]:g} m, Y {moved[1]:g} m ({suggested})")
        self.draw_clouds()

    def action_suggested(self) -> None:
        """The offset that the vehicle's size suggests."""
        self.offsets.pop(self.measured, None)
        self.draw_clouds()

    def write_own(self) -> bool:
        """Both sides as one cloud, as `vehicles merge` writes it; the maps are text."""
        clouds, job = self.clouds, self.cloud
        if self.maps:
            return False
        if clouds is None or job is None:
            self.say("r computes it first")
        elif clouds.simulated is None:
            self.say(f"there is nothing to merge with: {self.host.inside(clouds.lacking)}", bad=True)
        else:
            what = "both frames" if clouds.at is None else "both vehicles"
            name = merged_name(clouds, self.measured, self._variant_here())
            write = partial(write_merged, clouds, self._offset())
            self.exports.ask_file(f"Write {what}, as one cloud, to which file?", name, write, job)
        return True
