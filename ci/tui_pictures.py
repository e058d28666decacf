"""Draws every screen of the terminal interface on small projects of simulated measurements. Run by ci/tui_pictures."""

from __future__ import annotations

import asyncio
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Awaitable, Callable
from dataclasses import replace
from multiprocessing import resource_tracker
from pathlib import Path
from typing import Any, cast

from textual.pilot import Pilot
from tui_project import SCENARIOS, make_bench, make_drive

from lidarcheck.session.worker import Worker
from lidarcheck.tui.actions import SCREENS
from lidarcheck.tui.app import LidarcheckApp
from lidarcheck.tui.screens.blooming.screen import Blooming
from lidarcheck.tui.screens.cloud.screen import Cloud
from lidarcheck.tui.screens.explain.screen import Explain
from lidarcheck.tui.screens.goldens.screen import Goldens
from lidarcheck.tui.screens.overview.screen import Overview
from lidarcheck.tui.screens.pages.screen import PageView

ROOT = Path(__file__).resolve().parents[1]
IMAGES = ROOT / "docs" / "images"
SIZE, WIDE = (80, 24), (120, 36)
PATIENCE_S = 600.0
NOON = time.mktime((2030, 1, 2, 12, 0, 0, 0, 0, -1))
Prepare = Callable[[LidarcheckApp, Pilot[int]], Awaitable[None]]


# The screens


async def until(pilot: Pilot[int], true: Callable[[], Any]) -> None:
    """Wait until something is so."""
    end = time.monotonic() + PATIENCE_S
    while not true():
        if time.monotonic() > end:
            sys.exit("a screen is not what it should be after ten minutes")
        await pilot.pause(0.05)


def text_of(app: LidarcheckApp) -> str:
    """What is on the screen."""
    strips = app.screen._compositor.render_strips()
    return "\n".join("".join(segment.text for segment in strip) for strip in strips)


async def settled(app: LidarcheckApp, pilot: Pilot[int]) -> None:
    """Wait until nothing has changed for two seconds, and nothing says that it is at work."""
    before, since, end = "", time.monotonic(), time.monotonic() + PATIENCE_S
    while time.monotonic() - since < 2.0:
        if time.monotonic() > end:
            sys.exit(f"a screen is still at work after ten minutes:\n{text_of(app)}")
        now = text_of(app)
        at_work = re.search(r"\bcomputing\b|not yet known", now) or "..." in now.splitlines()[-2]
        if now != before or at_work or app.numbers.engine.busy:
            before, since = now, time.monotonic()
        await pilot.pause(0.1)


async def edited(app: LidarcheckApp, pilot: Pilot[int]) -> None:
    """Two edits of the table, the second one of rows that were marked."""
    await pilot.press("f5")
    await until(pilot, lambda: app.view.NAME == "blooming" and cast(Blooming, app.view).file is not None)
    await settled(app, pilot)
    await pilot.press(*("down",) * 14, *("left_square_bracket",) * 2)
    await settled(app, pilot)
    await pilot.press("down", "shift+down", *("left_square_bracket",) * 2)
    await settled(app, pilot)


async def overview(app: LidarcheckApp, pilot: Pilot[int]) -> None:
    """Two edits, and all scenarios are run; hours and how long each took are not those of the day of the picture."""
    await edited(app, pilot)
    await pilot.press("f2")
    await until(pilot, lambda: app.view.NAME == "overview")
    await run_scenarios(app, pilot)
    app.numbers.began = NOON
    app.view.draw()


async def run_scenarios(app: LidarcheckApp, pilot: Pilot[int]) -> None:
    """All of them, on Overview."""
    view = cast(Overview, app.view)
    await pilot.press("g", "c")
    await until(pilot, lambda: view.on_scenarios)
    await pilot.press("R")
    await until(pilot, lambda: len(view.runs.last) == len(SCENARIOS) and not view.running)
    for name, outcome in view.runs.last.items():
        view.runs.last[name] = replace(outcome, time=NOON, seconds=1.0)
    await pilot.press("end", "home", *("down",) * (len(SCENARIOS) - 1))
    app.say(app.project.in_words())


async def blooming(app: LidarcheckApp, pilot: Pilot[int]) -> None:
    """Some rows are raised towards what was measured."""
    await edited(app, pilot)


async def blooming_settings(app: LidarcheckApp, pilot: Pilot[int]) -> None:
    """The settings of distances."""
    await edited(app, pilot)
    await pilot.press("E")


async def computed(app: LidarcheckApp, pilot: Pilot[int]) -> None:
    """What is under the cursor is computed."""
    view = cast(PageView, app.view)
    await pilot.press("r")
    await until(pilot, lambda: view.page is not None or (view.job is not None and view.fault_of(view.job)))
    if view.page is None:
        sys.exit(f"{view.NAME} computed nothing:\n{text_of(app)}")


async def histograms(app: LidarcheckApp, pilot: Pilot[int]) -> None:
    """The histograms of AREA."""
    await computed(app, pilot)
    await pilot.press(*"nnn")  # AREA is the second feature


async def noise(app: LidarcheckApp, pilot: Pilot[int]) -> None:
    """A panel in the middle of the list."""
    await computed(app, pilot)
    await pilot.press("n", "n")


async def explain(app: LidarcheckApp, pilot: Pilot[int]) -> None:
    """The case is explained; how long that takes is not shown any more when it is done."""
    view = cast(Explain, app.view)
    await until(pilot, lambda: view.cases)
    await pilot.press("r")
    await until(pilot, lambda: not view.running and (view.cases[0].found or view.cases[0].fault))
    if view.cases[0].fault:
        sys.exit(f"explain failed: {view.cases[0].fault}")


async def goldens(app: LidarcheckApp, pilot: Pilot[int]) -> None:
    """What a run of all scenarios leaves, and a review of the first."""
    view = cast(Goldens, app.view)
    await pilot.press("f2")
    await until(pilot, lambda: app.view.NAME == "overview")
    await run_scenarios(app, pilot)
    await pilot.press("f9")
    await until(pilot, lambda: app.view is view and view.waiting)
    await pilot.press("r")
    await until(pilot, lambda: not view.running and (view.waiting[0].found or view.waiting[0].fault))
    if view.waiting[0].fault:
        sys.exit(f"the review failed: {view.waiting[0].fault}")
    app.say(app.project.in_words())


async def cloud(app: LidarcheckApp, pilot: Pilot[int]) -> None:
    """The car in the middle of the list, as the model of the other measurements shows it."""
    view = cast(Cloud, app.view)
    while view.clouds is None or view.clouds.at is None or "25m" not in view.measured:
        await pilot.press("n")
        await until(pilot, lambda: view.running is None)


async def cloud_maps(app: LidarcheckApp, pilot: Pilot[int]) -> None:
    """The street, compared."""
    view = cast(Cloud, app.view)
    view.show_maps(True)
    await computed(app, pilot)


# A screen without a line here is drawn as it comes up.
PREPARE: dict[str, Prepare] = {
    "overview": overview,
    "histograms": histograms,
    "noise": noise,
    "blooming": blooming,
    "blooming_wide": blooming,
    "blooming_settings": blooming_settings,
    "ghosts": computed,
    "cloud": cloud,
    "cloud_maps": cloud_maps,
    "explain": explain,
    "goldens": goldens,
}
SIZES = {"blooming_wide": WIDE}
"""Of those that are larger than the others."""
BENCH = ("overview", "blooming", "goldens")
"""The screens that show the project of scenarios and a table; the others show that of measurements."""


def without_links(svg: str) -> str:
    """The picture without the fonts that it would fetch: a picture in a repository fetches nothing."""
    svg = re.sub(r"@font-face \{.*?\}\s*", "", svg, flags=re.DOTALL)
    svg = re.sub(r"<!--.*?-->\s*", "", svg, flags=re.DOTALL)
    found = set(re.findall(r"https?://[^\s\"')]+", svg)) - {"http://www.w3.org/2000/svg"}
    if found:
        sys.exit(f"the picture would fetch {', '.join(sorted(found))}")
    return svg


def draw(project: Path, name: str, screen: str) -> None:
    """One screen as docs/images/tui_NAME.svg."""

    async def session() -> str:
        app = LidarcheckApp(project, theme="dark", screen=screen, worker=Worker())
        async with app.run_test(size=SIZES.get(name, SIZE)) as pilot:
            await until(pilot, lambda: app.reads and screen == app.view.NAME)
            await settled(app, pilot)
            if name in PREPARE:
                await PREPARE[name](app, pilot)
                await settled(app, pilot)
            return app.export_screenshot(title=f"lidarcheck tui: {project.name}")

    resource_tracker.ensure_running()  # what starts processes needs a stderr, which Textual takes away
    IMAGES.mkdir(parents=True, exist_ok=True)
    (IMAGES / f"tui_{name}.svg").write_text(without_links(asyncio.run(session())), encoding="utf-8")
    # What a screen leaves behind, unsaved edits above all, is not for the next one.
    shutil.rmtree(project / ".lidarcheck", ignore_errors=True)


def main(wanted: list[str]) -> None:
    """Every screen of the registry, or those that are named."""
    known = [*SCREENS, *(name for name in PREPARE if name not in SCREENS)]
    for name in wanted:
        if name not in known:
            sys.exit(f"error: there is no screen {name}; use {', '.join(known)}")
    with tempfile.TemporaryDirectory() as scratch:
        for name in wanted or known:
            screen = next(screen for screen in SCREENS if f"{name}_".startswith(f"{screen}_"))
            project, make = (
                (Path(scratch) / "bench", make_bench) if screen in BENCH else (Path(scratch) / "drive", make_drive)
            )
            if not project.exists():
                make(project)
            draw(project, name, screen)


if __name__ == "__main__":
    main(sys.argv[1:])
