"""Ghosts in the terminal interface: small frames of signs, their steps, the fit, what is written; with bad files."""

import numpy as np
import pytest

from ghost_frames import Recipe, made
from lidarcheck.calibration.ghosts.workflow import find_ghosts
from lidarcheck.errors import InputError
from lidarcheck.figures.data import Cloud
from lidarcheck.figures.pages.ghost_steps import steps_of
from lidarcheck.formats import load_scan
from lidarcheck.model import load_model
from lidarcheck.session.model_choice import NONE
from lidarcheck.session.project import read_project
from lidarcheck.session.state import load_state
from lidarcheck.tui.jobs.ghosts import ALL, FIT, ghost_jobs, sign_scans
from lidarcheck.tui.widgets.dialogs import Ask, AskText
from tui_kit import app_on, as_stored, done, drive, says, sees, text_of, until

HEAD = "X Y Z Point Layer EchoNumber WIDTH AREA PEAK\n"
FAINT = HEAD + "".join(f"20 {y} 0 {480 - y} 260 1 9 310 60\n" for y in range(3))
IDEAL = "Layer Point Distance MaterialID IncidenceAngle\n1 1 20.0 1 0.0\n"
BLOCK = {"layers": range(248, 280), "points": range(468, 496), "ratio": 2e-4}
STEPS = (
    "all points", "what is bright", "clusters of it (DBSCAN)", "the sign found", "the search at twice the range",
    "clusters there (DBSCAN)", "what is left",
)  # fmt: skip


@pytest.fixture(scope="session")
def frames(tmp_path_factory):
    """Two datasets with their ideal scans, and the model."""
    place = tmp_path_factory.mktemp("frames")
    for name, recipe in {"1_25m": Recipe(seed=61, **BLOCK), "2_45m": Recipe(seed=62, range_m=45.0, **BLOCK)}.items():
        frame = made(recipe)
        (place / f"{name}.txt").write_text(frame.scan_text)
        (place / f"{name}_ideal.txt").write_text(frame.ideal_text)
        (place / "SLIM.toml").write_text("# my sensor\n" + frame.model_text)
    return place


@pytest.fixture
def project(frames, tmp_path):
    """The datasets, one that shows no sign, and an empty file."""
    root = tmp_path / "project"
    (root / "signs").mkdir(parents=True)
    for path in frames.iterdir():
        (root / "signs" / path.name).write_bytes(path.read_bytes())
    (root / "signs/3_65m.txt").write_text(FAINT)
    (root / "signs/4_85m.txt").write_text("")
    return root


async def on_ghosts(app, pilot):
    await pilot.press("f6")
    view = next(view for view in app.views() if view.NAME == "ghosts")
    await until(pilot, lambda: app.view is view and view.listed)
    return view


async def computed(app, pilot, view, name):
    """The page of an entry of the list."""
    names = [job.name for job in view.listed]
    await pilot.press("home", *["down"] * names.index(name))
    assert view.job.name == name
    await pilot.press("r")
    await until(pilot, lambda: view.running is None and view.page is not None, lambda: text_of(app))
    return view.page


# The library


def test_the_steps_hold_what_they_say(frames):
    scan = load_scan(frames / "1_25m.txt")
    found = find_ghosts(scan, name="1_25m")
    steps = {step.title: step.groups for step in steps_of(found)}
    assert tuple(steps) == STEPS
    assert len(steps["all points"]["all"]) == len(scan)
    bright = steps["what is bright"]["bright"]
    assert 0 < len(bright) < len(scan)
    clusters = steps["clusters of it (DBSCAN)"]
    assert sorted(np.concatenate(list(clusters.values()))) == sorted(bright)
    assert len(np.intersect1d(clusters["cluster 1"], found.signs[0].rows)) > 0.9 * len(clusters["cluster 1"])
    search = steps["the search at twice the range"]
    sign = found.signs[0]
    assert np.array_equal(search["sign"], np.sort(sign.rows))
    beyond = scan.range_m[search["at 2R"]] - 2.0 * sign.range_m
    assert np.all((beyond > -1.7) & (beyond < 4.2))
    dense = steps["clusters there (DBSCAN)"]
    assert sorted(np.concatenate(list(dense.values()))) == sorted(search["at 2R"])
    left = steps["what is left"]
    assert set(left["ghost"]) <= set(search["at 2R"])
    assert len(left["sign"]) + len(left["ghost"]) == len(found.stripped())


def test_a_sign_without_ghost_has_steps_too(frames):
    scan = load_scan(frames / "1_25m.txt")
    near = scan.take(np.flatnonzero(scan.range_m < 30.0))
    steps = {step.title: step.groups for step in steps_of(find_ghosts(near))}
    assert not len(steps["the search at twice the range"]["at 2R"])
    assert not len(steps["what is left"]["ghost"])
    assert len(steps["what is left"]["sign"])


# What belongs together


def put(root, *names, text=HEAD + "20 0 0 480 260 1 5 60 12\n"):
    for name in names:
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)


def test_datasets_are_told_by_their_names(tmp_path):
    put(tmp_path, "2_45m.txt", "1_25m.txt", "10_85.5m.txt", "a/ghost_69m.txt", "signs/x.txt", "1_25m_ghosts.txt")
    put(tmp_path, "frame_00.txt", "car_25m.txt", "design_1.txt", "sim_sign_69m.txt")
    put(tmp_path, "1_ideal.txt", "2_45m_ideal.txt", "a/ghost_69m_ideal.txt", text=IDEAL)
    found = {scan.name: scan.ideal and scan.ideal.name for scan in sign_scans(read_project(tmp_path))}
    assert found == {
        "1_25m.txt": "1_ideal.txt",
        "2_45m.txt": "2_45m_ideal.txt",
        "10_85.5m.txt": None,
        "a/ghost_69m.txt": "ghost_69m_ideal.txt",
        "signs/x.txt": None,
    }
    assert [job.name for job in ghost_jobs(read_project(tmp_path), "", None)][:3] == [ALL, FIT, "signs/x.txt"]


def test_what_cannot_be_computed_says_why(project):
    jobs = {job.name: job for job in ghost_jobs(read_project(project), NONE, None)}
    assert jobs[FIT].fault == "a fit needs a model: o chooses one"
    assert "4_85m.txt: the file is empty" in jobs["signs/4_85m.txt"].fault
    for path in project.glob("signs/*_ideal.txt"):
        path.unlink()
    jobs = {job.name: job for job in ghost_jobs(read_project(project), "", None)}
    assert jobs[FIT].fault.startswith("a fit needs ideal scans")
    for path in project.glob("signs/[12]_*m.txt"):
        path.write_text("")
    jobs = {job.name: job for job in ghost_jobs(read_project(project), "", None)}
    with pytest.raises(InputError, match=r"no dataset shows a sign.*3_65m.txt: no sign"):
        jobs[ALL].compute(lambda *_: None)
    (project / "signs/3_65m.txt").write_text("")
    assert "no dataset that can be read" in ghost_jobs(read_project(project), "", None)[0].fault


# The screen


def test_a_dataset_is_seen_step_by_step(project):
    async def do(app, pilot):
        view = await on_ghosts(app, pilot)
        await sees(app, pilot, "1_25m_ideal.txt, SLIM.toml")
        await pilot.press("right_square_bracket")
        await says(app, pilot, "the steps are on the page of a single dataset")
        page = await computed(app, pilot, view, "signs/1_25m.txt")
        await says(app, pilot, "signs/1_25m.txt: 1 sign")
        await sees(app, pilot, "AREA of sign and ghost")
        await sees(app, pilot, "PEAK of sign and ghost")
        await as_stored(app, pilot, "ghosts_80x24")
        for number, title in enumerate(STEPS, start=1):
            await pilot.press("right_square_bracket")
            await sees(app, pilot, f"1_25m: step {number} of 7, {title}: from above")
        rows = page.sections[-1].tables[0].rows
        await sees(app, pilot, f"⠶ sign: {rows[-2][3]}")
        await sees(app, pilot, f"o ghost: {rows[-1][3]}")
        await pilot.press("left_square_bracket")
        await sees(app, pilot, "step 6 of 7")
        await pilot.press("right_square_bracket", "right_square_bracket")
        await sees(app, pilot, "step 1 of 7")
        await pilot.press("v")
        await sees(app, pilot, "all points: from the side")
        await pilot.press("v")
        await sees(app, pilot, "all points: as the sensor sees it")
        await pilot.press("left")
        await sees(app, pilot, "1_25m: sign and ghost: as the sensor sees it")
        await pilot.press("t")
        await sees(app, pilot, "What was found")
        await until(pilot, lambda: view.query_one("#words").has_focus)
        await sees(app, pilot, "Ghost over sign, and medians")
        await pilot.press("end")
        await sees(app, pilot, "PEAK, mean")

    drive(app_on(project), do)
    assert load_state(project).selected["ghosts"] == "signs/1_25m.txt"


def test_all_datasets_show_the_course_and_who_is_left_out(project):
    async def do(app, pilot):
        view = await on_ghosts(app, pilot)
        await sees(app, pilot, "3 of 4, SLIM.toml")
        page = await computed(app, pilot, view, ALL)
        words = " ".join(page.sections[0].words)
        assert "3_65m.txt: no sign: the brightest of 3 echoes has AREA 310" in words
        assert "4_85m.txt: the file is empty" in words
        titles = [figure.title for figure in page.figures()]
        assert "Ghost over sign: range and size" in titles
        assert not any(isinstance(f, Cloud) and ": step " in f.title for f in page.figures())
        sides = next(section for section in page.sections if section.title == "Real and simulated")
        assert {row[0] for row in sides.tables[0].rows} == {"1_25m", "2_45m"}
        await sees(app, pilot, "Beams of the sign with a ghost")
        await sees(app, pilot, "Left out: signs/3_65m.txt: no sign")
        await as_stored(app, pilot, "ghosts_160x50")
        await sees(app, pilot, "AREA of the ghosts ⠤⠤ real")

    drive(app_on(project), do, size=(160, 50))


def test_without_a_sign_the_list_says_what_is_there(project):
    async def do(app, pilot):
        view = await on_ghosts(app, pilot)
        await pilot.press("end", "r")
        await says(app, pilot, "4_85m.txt: the file is empty")
        await pilot.press("up", "r")
        await says(app, pilot, "3_65m.txt: no sign: the brightest of 3 echoes has AREA 310")
        assert view.running is None
        await sees(app, pilot, "cannot")
        assert "AREA 310" in view.fault_of(view.job)

    drive(app_on(project), do)


def test_the_effect_is_fitted_and_its_model_written(project):
    async def do(app, pilot):
        view = await on_ghosts(app, pilot)
        page = await computed(app, pilot, view, FIT)
        (parameters,) = page.sections[0].tables
        rows = {row[0]: row for row in parameters.rows}
        assert float(rows["strength"][2]) < 2e-4 < float(rows["strength"][3])
        await says(app, pilot, "fit: retro_ghost: strength")
        await done(app, "stripped points")
        await until(pilot, lambda: isinstance(app.asking, AskText))
        await sees(app, pilot, "model.toml, the model with the effect")
        await pilot.press("enter")
        await says(app, pilot, "ghosts: model.toml written")

    drive(app_on(project), do)
    text = (project / "ghosts/model.toml").read_text()
    assert text.startswith("# my sensor\n")
    effect = load_model(project / "ghosts/model.toml").effects[-1]
    assert effect.strength == pytest.approx(2e-4, rel=0.2)


def test_what_is_left_is_written_and_nothing_replaced(project):
    async def do(app, pilot):
        view = await on_ghosts(app, pilot)
        await done(app, "stripped points")
        await says(app, pilot, "nothing is computed here yet")
        await computed(app, pilot, view, ALL)
        for said in ("ghosts: 1_25m_ghosts.pcd, 2_45m_ghosts.pcd written", "1_25m_ghosts.pcd: is there already"):
            await done(app, "stripped points")
            await until(pilot, lambda: isinstance(app.asking, AskText))
            await pilot.press("enter")
            await says(app, pilot, said)
        await done(app, "stripped points")
        await until(pilot, lambda: isinstance(app.asking, AskText))
        await pilot.press("escape")
        await until(pilot, lambda: not isinstance(app.asking, AskText))
        await done(app, "stripped points")
        await until(pilot, lambda: isinstance(app.asking, AskText))
        await pilot.press(*"/a/b", "enter")
        await says(app, pilot, "cannot be made")
        await pilot.press("ctrl+r")
        await until(pilot, lambda: app.reads == 2)
        assert [job.name for job in view.listed][:2] == [ALL, FIT]
        assert len(view.listed) == 6, "what was written is no dataset"

    drive(app_on(project), do)
    for name in ("1_25m", "2_45m"):
        left = load_scan(project / f"ghosts/{name}_ghosts.pcd")
        found = find_ghosts(load_scan(project / f"signs/{name}.txt"))
        for label in (1, 2):
            assert np.count_nonzero(left.extra["Label"] == label) == np.count_nonzero(found.label == label) > 0


def test_the_least_and_the_model_are_chosen_and_kept(project):
    async def do(app, pilot):
        view = await on_ghosts(app, pilot)
        with_model = await computed(app, pilot, view, "signs/1_25m.txt")
        assert any("real" in getattr(figure, "samples", {}) for figure in with_model.figures())
        await done(app, "next model")
        await says(app, pilot, "no model: real scans alone")
        assert view.page is None
        page = await computed(app, pilot, view, "signs/1_25m.txt")
        assert "Not compared with a model: none is chosen." in page.sections[0].words
        for typed, said in ((*"x",), "x is no amplitude"), ((*"7000",), "bright from 7000; r computes with it"):
            await done(app, "least amplitude")
            await until(pilot, lambda: isinstance(app.asking, AskText))
            await pilot.press("end", *["backspace"] * 5, *typed, "enter")
            await says(app, pilot, said)
        await sees(app, pilot, "bright from 7000")
        await pilot.press("r")
        await says(app, pilot, "a sign's have at least 7000")
        await done(app, "next model")
        await says(app, pilot, "model: signs/SLIM.toml")

    drive(app_on(project), do)
    state = load_state(project)
    assert (state.selected["ghosts.bright"], state.selected["model"]) == ("7000", "signs/SLIM.toml")

    async def again(app, pilot):
        view = await on_ghosts(app, pilot)
        assert view.job.name == "signs/1_25m.txt"
        assert "bright from 7000" in view.job.words
        await done(app, "least amplitude")
        await until(pilot, lambda: isinstance(app.asking, AskText))
        await pilot.press("end", *["backspace"] * 4, "0", "enter")
        await says(app, pilot, "bright by the sensor")

    drive(app_on(project), again)


def test_a_damaged_choice_in_the_state_is_none(project):
    async def do(app, pilot):
        app.state.selected["ghosts.bright"] = "much"
        view = await on_ghosts(app, pilot)
        assert "bright" not in view.job.words

    drive(app_on(project), do)


def test_without_scans_it_says_what_they_are_called(tmp_path):
    async def do(app, pilot):
        await pilot.press("f6")
        await sees(app, pilot, "no scans of signs: called as 1_25m.txt")
        await pilot.press("r")
        await says(app, pilot, "there is nothing to compute here")
        await pilot.press("f", "right_square_bracket", "left_square_bracket", "v", "e", "t", "n")
        await done(app, "next model")
        await says(app, pilot, "there is no model in the project")
        await pilot.press("f6", "f1")
        await until(pilot, lambda: isinstance(app.asking, Ask))
        await sees(app, pilot, "Datasets: scans called as 1_25m.txt")

    drive(app_on(tmp_path), do)


@pytest.mark.parametrize("size", [(80, 24), (160, 50)])
def test_any_size_can_be_had(project, size):
    async def do(app, pilot):
        view = await on_ghosts(app, pilot)
        await computed(app, pilot, view, "signs/1_25m.txt")
        for width, height in ((1, 1), (30, 8), (200, 3), (5, 60), size):
            await pilot.resize_terminal(width, height)
            await until(pilot, lambda width=width: app.size.width == width)
            await pilot.press("right_square_bracket", "f")
        await sees(app, pilot, "1_25m")

    drive(app_on(project), do, size=size)
