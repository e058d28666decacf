"""Draws every screen of the terminal interface on a small project of simulated measurements. Run by ci/tui_pictures."""

from __future__ import annotations

import asyncio
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Awaitable, Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

from textual.pilot import Pilot

from lidarcheck.cli import main as lidarcheck
from lidarcheck.formats.lut import y_of_scaled
from lidarcheck.tui.app import LidarcheckApp
from lidarcheck.tui.core.actions import SCREENS
from lidarcheck.tui.screens.blooming import Blooming
from lidarcheck.tui.screens.overview import Overview

ROOT = Path(__file__).resolve().parents[1]
IMAGES = ROOT / "docs" / "images"
SIZE = (160, 42)
PATIENCE_S = 600.0
SCENARIOS = ("background_SLIM", "range_sweep_SLIM", "retro_reflector_SLIM", "incidence_SLIM", "weak_targets_SLIM")
X = (-160, -120, -80, -50, -33, -20, -10, -6, -3, 0, 3, 6, 10, 20, 33, 50, 80, 100, 120, 140, 200)

Prepare = Callable[[LidarcheckApp, Pilot[int]], Awaitable[None]]


# The project


def run(*words: object) -> None:
    """A command, as a user runs it."""
    if lidarcheck([*map(str, words), "--quiet"]) != 0:
        sys.exit(f"lidarcheck {' '.join(map(str, words))} failed")


def make_project(root: Path) -> None:
    """Scenarios whose model has moved, and a sign at three distances, simulated with bloom that the table lacks."""
    for part in ("scenarios", "goldens", "signs"):
        (root / part).mkdir(parents=True)
    for name in SCENARIOS:
        for part in ("scenarios", "goldens"):
            shutil.copy(ROOT / part / f"{name}.toml", root / part)
    shutil.copytree(ROOT / "scenarios" / "models", root / "scenarios" / "models")
    moved = root / "scenarios" / "models" / "SLIM.toml"
    text = moved.read_text(encoding="utf-8")
    moved.write_text(text.replace("[materials", "[sensor]\nsignal_at_1m = 6180.0\n\n[materials", 1), encoding="utf-8")
    scaled = [1000 if x == 0 else 560 - abs(x) // 2 for x in X]
    table = f"PostPro.LUT_blooming_X = {', '.join(map(str, X))}\n"
    table += f"PostPro.LUT_blooming_Y = {', '.join(f'{y_of_scaled(s):.7f}' for s in scaled)}\n"
    (root / "signs" / "vertical_lut.ini").write_text(table, encoding="utf-8")
    with tempfile.TemporaryDirectory() as scratch:
        blooming = Path(scratch) / "blooming.toml"
        text = (ROOT / "scenarios" / "models" / "scenes_SLIM.toml").read_text(encoding="utf-8")
        blooming.write_text(f'{text}\n[[effects]]\nname = "blooming_vertical"\n', encoding="utf-8")
        for distance in ("69m", "156m", "199m"):
            sign(root, blooming, distance)


def sign(root: Path, model: Path, distance: str) -> None:
    """A sign of the built-in scenes, cast in the columns about it, and what the sensor would report of it."""
    scene = (ROOT / f"src/lidarcheck/scenes/builtin/sign_vertical_{distance}.toml").read_text(encoding="utf-8")
    materials = ROOT / "src/lidarcheck/scenes/materials.toml"
    file = model.with_name(f"{distance}.toml")
    head = re.sub(r"^materials = .*$", f'materials = "{materials.as_posix()}"', scene, flags=re.MULTILINE)
    file.write_text(head + "\n[scene.sampling]\nlayers = [170, 380]\npoints = [440, 520]\n", encoding="utf-8")
    ideal = root / "signs" / f"ideal_sign_{distance}.parquet"
    run("scene", file, "--out", ideal)
    run("simulate", ideal, "--model", model, "--out", root / "signs" / f"simulated_sign_{distance}.csv", "--seed", 7)


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
    before, since = "", time.monotonic()
    while time.monotonic() - since < 2.0:
        now = text_of(app)
        if now != before or "..." in now.splitlines()[-2]:
            before, since = now, time.monotonic()
        await pilot.pause(0.1)


async def overview(app: LidarcheckApp, pilot: Pilot[int]) -> None:
    """All scenarios are run; the hour and how long each took are not those of the day that the picture was made."""
    view = cast(Overview, app.view)
    await pilot.press("a")
    await until(pilot, lambda: len(view.runs.last) == len(SCENARIOS) and not view.running)
    noon = time.mktime((2030, 1, 2, 12, 0, 0, 0, 0, -1))
    for name, outcome in view.runs.last.items():
        view.runs.last[name] = replace(outcome, time=noon, seconds=1.0)
    await pilot.press("end", "home", *("down",) * (len(SCENARIOS) - 1))
    app.say(app.project.in_words())


async def blooming(app: LidarcheckApp, pilot: Pilot[int]) -> None:
    """Some rows are raised towards what was measured."""
    plots = cast(Blooming, app.view).plots
    await until(pilot, lambda: plots.expected is not None)
    await pilot.press(*("down",) * 14, "shift+down", "shift+down", *("right_square_bracket",) * 2)
    await until(pilot, lambda: plots.expected is not None)


async def blooming_four(app: LidarcheckApp, pilot: Pilot[int]) -> None:
    """All four features, and the settings of distances."""
    await blooming(app, pilot)
    await pilot.press("V", "E")


# A screen without a line here is drawn as it comes up.
PREPARE: dict[str, Prepare] = {"overview": overview, "blooming": blooming, "blooming_four": blooming_four}


def without_links(svg: str) -> str:
    """The picture without the fonts that it would fetch: a picture in a repository fetches nothing."""
    svg = re.sub(r"@font-face \{.*?\}\s*", "", svg, flags=re.DOTALL)
    svg = re.sub(r"<!--.*?-->\s*", "", svg, flags=re.DOTALL)
    found = set(re.findall(r"https?://[^\s\"')]+", svg)) - {"http://www.w3.org/2000/svg"}
    if found:
        sys.exit(f"the picture would fetch {', '.join(sorted(found))}")
    return svg


def draw(project: Path, name: str) -> None:
    """One screen as docs/images/tui_NAME.svg."""

    screen = next(screen for screen in SCREENS if f"{name}_".startswith(f"{screen}_"))

    async def session() -> str:
        app = LidarcheckApp(project, theme="dark", screen=screen)
        async with app.run_test(size=SIZE) as pilot:
            await until(pilot, lambda: app.reads and screen == app.view.NAME)
            await settled(app, pilot)
            if name in PREPARE:
                await PREPARE[name](app, pilot)
                await settled(app, pilot)
            return app.export_screenshot(title=f"lidarcheck tui: {project.name}")

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
        project = Path(scratch) / "bench"
        make_project(project)
        for name in wanted or known:
            draw(project, name)


if __name__ == "__main__":
    main(sys.argv[1:])
