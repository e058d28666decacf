"""A small project for the terminal interface, bad files among the good ones; and a child that edits and is killed."""

import asyncio
import difflib
import json
import os
import re
import time
from pathlib import Path

from textual import _wait

from blooming_kit import lut_text, sign_model
from lidarcheck.harness.gate.evidence import KpiEvidence, KpiVerdict
from lidarcheck.harness.kpis.spec import KpiSpec
from lidarcheck.harness.reports.results import CheckReport, KpiResult, ScenarioResult
from lidarcheck.model.files.model_file import save_model
from lidarcheck.tui.app import LidarcheckApp
from lidarcheck.tui.widgets import dialogs

# Plots are made of what the terminal shows: in tests one with UTF-8, whatever the machine has.
os.environ |= {"LC_ALL": "C.UTF-8", "TERM": "xterm-256color"}
dialogs.UNASKED_S = 0.0  # tests answer at once; the one of it sets it again
# After each key textual's pilot sleeps until the process is idle. It is the thread of the keys that has to be: what
# computes beside it is waited for with `until`, by the tests that are about it.
_wait.process_time = time.thread_time
_wait.SLEEP_GRANULARITY = 0.002
_wait.SLEEP_IDLE = 0.0003
ROOT = Path(__file__).resolve().parents[2]
SNAPSHOTS = ROOT / "tests/snapshots"
LUT = "# our sign\r\n" + lut_text().replace("\n", "\r\n") + "; the end\r\nPostPro.Other = 7"
HORIZONTAL = "PostPro.LUT_bloomingH_X = 0, 1, 2, 4\nPostPro.LUT_bloomingH_Y = 1, 0.02, 0.0002, 0\n"
OFFSETS = range(-60, 61, 3)


def profile_text():
    rows = [f"{x},69.0,{40 + abs(x) // 3},{300 + 4 * (60 - abs(x))},6.0" for x in OFFSETS if abs(x) > 3]
    return "offset_spad_rows,range_m,PEAK,AREA,WIDTH_ns\n" + "\n".join([*rows, "0,69.0,236,3559,20.0"]) + "\n"


def make_project(root):
    for name in ("scenarios", "goldens", "measured", "models"):
        (root / name).mkdir(parents=True)
    for name in ("background_SMART", "weak_targets_SLIM"):
        text = (ROOT / f"scenarios/{name}.toml").read_text().replace('"models/', '"../models/')
        (root / f"scenarios/{name}.toml").write_text(text)
        (root / f"goldens/{name}.toml").write_bytes((ROOT / f"goldens/{name}.toml").read_bytes())
    for name in ("SLIM", "SMART"):
        (root / f"models/{name}.toml").write_bytes((ROOT / f"scenarios/models/{name}.toml").read_bytes())
    save_model(sign_model("SLIM"), root / "models/sign_SLIM.toml")
    (root / "scenarios/broken.toml").write_text("kpis = [\n")
    (root / "a_lut.ini").write_bytes(LUT.encode())
    (root / "both_lut.ini").write_text(lut_text() + HORIZONTAL)
    (root / "bad_lut.ini").write_text("PostPro.LUT_blooming_X = 1, 2\nPostPro.LUT_blooming_Y = 1, x\n")
    (root / "measured/sign_69m.csv").write_text(profile_text())
    (root / "measured/sign_157m.csv").write_text(profile_text().replace("69.0", "157.0"))
    (root / "measured/empty.txt").write_text("")
    (root / "notes.txt").write_text("hello\n")
    return root


def fake_check(paths, progress, moment_s=0.02):
    """A check that takes a moment and finds that the second KPI fell out."""
    for done in range(5):
        progress(done, 5, "")
        time.sleep(moment_s)
    name = Path(paths[0]).stem
    specs = [KpiSpec(kpi, "mean", "1", "target", 0.1, high=3.0) for kpi in ("area_mean", "peak_mean")]
    kpis = tuple(
        KpiResult(spec, verdict, 1.0, now, KpiEvidence(verdict, now - 1.0, 0.01, 0.02, 16), note=note, fresh=(now,))
        for spec, verdict, now, note in zip(
            specs, (KpiVerdict.EQUIVALENT, KpiVerdict.REGRESSED), (1.01, 1.5), ("", "beyond the tolerance"), strict=True
        )
    )
    return CheckReport((ScenarioResult(name, Path(paths[0]), "", kpis),), (), None, "", 2, 1e-3, 0.1, {})


def drive(app, do, size=(80, 24)):
    """Run an app headless; `do` gets the app and its pilot once the project was read."""

    async def session():
        async with app.run_test(size=size) as pilot:
            await until(pilot, lambda: app.reads)
            await do(app, pilot)

    asyncio.run(session())


WAIT_S = float(os.environ.get("LIDARCHECK_TEST_WAIT_S", "60"))


async def until(pilot, true, shown=lambda: "it did not come about", seconds=WAIT_S):
    """Wait until something is so; `shown` says what is there instead."""
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, shown()
        await pilot.pause(0.005)


def app_on(project, **how):
    return LidarcheckApp(project, check=fake_check, **how)


def text_of(app):
    """What is on the screen, as text."""
    strips = app.screen._compositor.render_strips()
    return "\n".join("".join(segment.text for segment in strip).rstrip() for strip in strips) + "\n"


async def sees(app, pilot, text):
    """Wait until a text is on the screen: a dialog is drawn a moment after it opens."""
    await until(pilot, lambda: text in text_of(app), lambda: text_of(app))


async def misses(app, pilot, text):
    """Wait until a text is no longer on the screen."""
    await until(pilot, lambda: text not in text_of(app), lambda: text_of(app))


async def says(app, pilot, text):
    """Wait until the status line says something."""
    await until(pilot, lambda: text in status(app), lambda: status(app))


def status(app):
    return app.bars.status[0]


def written(directory):
    """The files below a directory with their bytes."""
    return {str(path.relative_to(directory)): path.read_bytes() for path in directory.rglob("*") if path.is_file()}


def apart_from_key(directory):
    """(what a command or an export has written, the same for both; the files that it says it was computed from).

    Their keys are of different nodes, and so are the hashes of the pages that show them.
    """
    files = written(directory)
    result = json.loads(files["result.json"])
    origin = result.pop("computed_from", {"key": "", "files": {}})
    result["provenance"].pop("computed from", None)
    shown = files["report.html"].decode()
    assert origin["key"] in shown
    files["report.html"] = re.sub(r"\n<div><dt>computed from</dt>.*?</div>", "", shown, flags=re.DOTALL)
    del result["page"]["sha256"]
    return files | {"result.json": result}, origin["files"]


def undated(app):
    """What is on the screen, with every time of day the same."""
    return re.sub(r"\d\d-\d\d \d\d:\d\d( +[\d.]+ s)?", "12-31 23:59", text_of(app))


def difference(stored, app):
    stored_lines, lines = stored.read_text().splitlines(), undated(app).splitlines()
    return "\n".join(difflib.unified_diff(stored_lines, lines, "stored", "now", lineterm=""))


async def as_stored(app, pilot, name):
    """The screen is the text that is stored of it.

    `LIDARCHECK_SNAPSHOTS=write` stores it anew, to be looked at in the diff.
    """
    stored = SNAPSHOTS / f"{name}.txt"
    if os.environ.get("LIDARCHECK_SNAPSHOTS") == "write":
        await pilot.pause(4.0)
        SNAPSHOTS.mkdir(exist_ok=True)
        stored.write_text(undated(app))
    await until(pilot, lambda: undated(app) == stored.read_text(), lambda: difference(stored, app))


async def done(app, name):
    """Do what has no key, as the menu does it."""
    await app.do(next(action for action in app.able() if action.name == name))


def blooming(app):
    """The screen Blooming."""
    return next(view for view in app.views() if view.NAME == "blooming")


async def on_blooming(app, pilot):
    """Go there, and wait until the table is open."""
    await pilot.press("f5")
    view = blooming(app)
    await until(pilot, lambda: app.view is view and view.file is not None)
    return view


def scaled(view, row):
    """The scaled value of a row of the table."""
    return view.file.current.tables[view.axis].rows()[row].scaled
