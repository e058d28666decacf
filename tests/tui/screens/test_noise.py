"""Noise in the terminal interface: halls of small frames, found, computed, looked at, with bad files among them."""

import threading
from pathlib import Path

import pytest

import panel_halls as ph
from hidden.places import PANEL_10, PANEL_50, PANEL_80
from lidarcheck.session.model_choice import NONE, chosen_model, likely_model, model_after, which_model
from lidarcheck.session.node import Cancelled
from lidarcheck.session.project import Entry, read_project
from lidarcheck.session.state import load_state
from lidarcheck.tui.jobs import noise
from lidarcheck.tui.jobs.noise import halls_of, noise_jobs
from lidarcheck.tui.widgets.dialogs import Ask
from tui_kit import app_on, as_stored, done, drive, says, sees, text_of, until

HEAD = "X Y Z Point Layer EchoNumber WIDTH AREA PEAK\n"
ROW = "20 0 0 480 260 1 5 60 12\n"
IDEAL = "Layer Point Distance MaterialID IncidenceAngle\n1 1 20.0 1 0.0\n"


@pytest.fixture(scope="session")
def made(tmp_path_factory):
    """A hall with three panels and three frames, its ideal scan and its model."""
    place = tmp_path_factory.mktemp("made")
    spots = [
        ph.Spot(12.0, -3.0, 0.0, 0.5, 0.4, PANEL_80),
        ph.Spot(30.0, 0.5, 0.0, 1.0, 0.9, PANEL_50),
        ph.Spot(65.0, 4.0, 0.0, 1.6, 1.5, PANEL_10),
    ]
    ph.write_frames(place, ph.Hall(spots, stands=False), "SMART", range(3), ph.SMALL)
    return place


@pytest.fixture
def project(made, tmp_path):
    """The hall with an ideal scan and a model, and without either, a frame of which has a fault; a wall."""
    root = tmp_path / "project"
    for name in ("hall", "open", "other"):
        (root / name).mkdir(parents=True)
    for path in made.iterdir():
        (root / "hall" / path.name).write_bytes(path.read_bytes())
        if path.name.startswith("frame"):
            (root / "open" / path.name).write_bytes(path.read_bytes())
    (root / "open/frame_07.txt").write_text("")
    for i in range(2):
        (root / f"other/wall_{i}.txt").write_text(HEAD + ROW * 3)
    (root / "other/single.txt").write_text(HEAD + ROW)
    return root


async def on_noise(app, pilot):
    await pilot.press("f4")
    view = next(view for view in app.views() if view.NAME == "noise")
    await until(pilot, lambda: app.view is view and view.listed)
    return view


async def computed(app, pilot, view):
    """The page of what is under the cursor."""
    await pilot.press("r")
    await until(pilot, lambda: view.running is None and (view.page or view.fault_of(view.job)), lambda: text_of(app))
    return view.page


# What belongs together


def names(root):
    return {hall.name: [path.name for path in hall.frames] for hall in halls_of(read_project(root))}


def put(root, *names, text=HEAD + ROW):
    for name in names:
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)


def test_frames_of_one_scene_are_told_by_their_names(tmp_path):
    put(tmp_path, "run/frame_2.txt", "run/frame_10.txt", "run/frame_1.txt", "run/note.txt")
    put(tmp_path, "signs/1_25m.txt", "signs/2_45m.txt", "lab_smart.txt", "panels/one.txt", "slab_9.txt")
    put(tmp_path, "panels/panel_01_real.txt", "panels/panel_02_real.txt", "panels/panel_01_simulated.txt")
    assert names(tmp_path) == {
        "run/frame": ["frame_1.txt", "frame_2.txt", "frame_10.txt"],
        "lab_smart": ["lab_smart.txt"],
        "panels/one": ["one.txt"],
    }


def test_simulated_frames_and_ideal_scans_go_with_theirs(tmp_path):
    put(tmp_path, "a/real_0.txt", "a/real_1.txt", "a/sim_0.txt", "a/sim_1.txt")
    put(tmp_path, "b/hall_0.txt", "b/hall_1.txt", "c/lab_0.txt", "c/lab_1.txt", "c/hall_0.txt", "c/hall_1.txt")
    put(tmp_path, "a/scene.txt", "b/hall_0_ideal.txt", "b/hall_1_ideal.txt", text=IDEAL)
    put(tmp_path, "c/lab_ideal.txt", "c/other_ideal.txt", text=IDEAL)
    halls = {hall.name: hall for hall in halls_of(read_project(tmp_path))}
    assert {name: [p.name for p in hall.ideals] for name, hall in halls.items()} == {
        "a/real": ["scene.txt"],
        "b/hall": ["hall_0_ideal.txt", "hall_1_ideal.txt"],
        "c/hall": [],
        "c/lab": ["lab_ideal.txt"],
    }
    assert [path.name for path in halls["a/real"].simulated] == ["sim_0.txt", "sim_1.txt"]
    assert not halls["c/lab"].simulated


def test_a_hall_without_a_sound_frame_says_why(tmp_path):
    put(tmp_path, "hall_0.txt", "hall_1.txt", text="")
    (job,) = noise_jobs(read_project(tmp_path), "")
    assert "hall_0.txt: the file is empty" in job.fault
    assert "hall_1.txt" in job.fault


def test_the_model_is_the_chosen_one_or_the_only_one(project, tmp_path):
    found = read_project(project)
    assert chosen_model(found, "", project / "open").name == "hall/model.toml"
    (project / "second.toml").write_bytes((project / "hall/model.toml").read_bytes())
    found = read_project(project)
    assert chosen_model(found, "", project / "open") is None
    assert chosen_model(found, "", project / "hall").name == "hall/model.toml"
    assert chosen_model(found, "second.toml", project / "hall").name == "second.toml"
    assert chosen_model(found, NONE, project / "hall") is None
    assert model_after(found, chosen_model(found, "second.toml", project)) == NONE
    assert model_after(found, None) == "hall/model.toml"


def test_one_rule_for_the_model_that_is_meant():
    def entries(*names):
        return [Entry(Path("p", name), "model", name) for name in names]

    both = entries("a/SLIM.toml", "a/SMART.toml", "b/other_SLIM.toml")
    assert likely_model(both, Path("p/a"), "SMART").name == "a/SMART.toml"
    assert likely_model(both, Path("p/b"), "SLIM").name == "b/other_SLIM.toml"
    assert likely_model(both, Path("p"), "SLIM").name == "a/SLIM.toml"
    assert likely_model(both, Path("p/b"), "").name == "b/other_SLIM.toml"
    assert likely_model(both, Path("p"), "") is None
    assert likely_model(both[:1], Path("p"), "SMART").name == "a/SLIM.toml"
    assert likely_model([], Path("p"), "SMART") is None
    assert which_model(both) == "any of 3 models could be meant: o chooses one"
    assert which_model([]) == "there is no model in this project"


def test_simulated_frames_stand_in_for_a_model(made, tmp_path):
    for i in range(2):
        for name in ("real", "sim"):
            (tmp_path / f"{name}_{i}.txt").write_bytes((made / f"frame_0{i}.txt").read_bytes())
    (job,) = noise_jobs(read_project(tmp_path), "")
    assert job.words == "2 frames, no ideal scan, so no model, 2 simulated frames"
    page = job.compute(lambda *_: None).page
    assert "% in 2 simulated" in page.summary
    assert page.provenance["command"].count("sim_") == 2
    assert len(page.panels.rows) == len(page.own) == 3


# The screen


def test_panels_are_found_and_gone_through(project):
    async def do(app, pilot):
        view = await on_noise(app, pilot)
        await sees(app, pilot, "not computed yet: r computes it")
        await sees(app, pilot, "3 frames, ideal.txt, model.toml")
        page = await computed(app, pilot, view)
        assert [row[0] for row in page.panels.rows] == ["1", "2", "3"]
        assert page.panels.rows[0][3] == "panel_80"
        await says(app, pilot, "3 panels from 12.0 to 65.0 m in 3 measured frames")
        await sees(app, pilot, "Panel 1 of 3")
        await sees(app, pilot, "AREA ▆ real ┌┐ sim")
        await as_stored(app, pilot, "noise_80x24")
        await pilot.press("n")
        await sees(app, pilot, "2/6 Panel 1, 12.0 m, panel_80: walk")
        await pilot.press("n")
        await sees(app, pilot, ">   2")
        await pilot.press("p", "p", "p")
        await sees(app, pilot, ">   3")
        await pilot.press("g", "p")
        await until(pilot, lambda: view.query_one("#panels").has_focus)
        await pilot.press("up", "pageup", "down")
        await sees(app, pilot, "Panel 2 of 3")
        await pilot.press("b")
        await sees(app, pilot, "Detection over range")
        await sees(app, pilot, "Panels, figures of all of them")
        await sees(app, pilot, ">   2")
        await pilot.press("home")  # in the panels' pane: back to the figures of one
        await sees(app, pilot, "Panel 1 of 3")
        await pilot.press("v")
        await says(app, pilot, "drawn as: qq")
        await pilot.press("t")
        await sees(app, pilot, "3 panels from 12.0 to 65.0 m in 3 measured frames")

    drive(app_on(project), do)


def test_all_figures_of_all_panels_are_seen(project):
    async def do(app, pilot):
        view = await on_noise(app, pilot)
        page = await computed(app, pilot, view)
        await pilot.press("b")
        titles = [[figure.title for figure in group] for group in view.groups(page)]
        seen = ("Detection over range", "Range noise over range", "Walk over all panels", "Range noise over amplitude")
        for title in seen:
            at = next(number for number, group in enumerate(titles) if title in group)
            await pilot.press(*["n"] * ((at - view.turned) % len(titles)))
            await sees(app, pilot, title)

    drive(app_on(project), do)
    assert load_state(project).selected["noise.all"] == "yes"

    async def again(app, pilot):
        view = await on_noise(app, pilot)
        assert view.all
        await computed(app, pilot, view)
        await sees(app, pilot, "Detection over range")

    drive(app_on(project), again)


def test_wide_it_shows_words_and_figures(project):
    async def do(app, pilot):
        view = await on_noise(app, pilot)
        await computed(app, pilot, view)
        await sees(app, pilot, "What they show")
        await sees(app, pilot, "distance ▆ real ┌┐ sim")
        await sees(app, pilot, "walk ⠤⠤ real")
        await as_stored(app, pilot, "noise_160x50")

    drive(app_on(project), do, size=(160, 50))


def test_models_are_gone_through_and_pages_are_kept(project):
    async def do(app, pilot):
        view = await on_noise(app, pilot)
        with_model = await computed(app, pilot, view)
        assert "simulated [%]" in with_model.panels.header
        await done(app, "next model")
        await says(app, pilot, "no model: real frames alone")
        await sees(app, pilot, "not computed yet")
        without = await computed(app, pilot, view)
        assert "simulated [%]" not in without.panels.header
        assert without.panels.rows[0][3].startswith("material ")
        await done(app, "next model")
        await says(app, pilot, "model: hall/model.toml")
        assert view.page is with_model
        await done(app, "next model")
        assert view.page is without

    drive(app_on(project), do)
    assert load_state(project).selected["model"] == NONE


def test_bad_files_and_walls_are_said(project):
    async def do(app, pilot):
        view = await on_noise(app, pilot)
        await sees(app, pilot, "3 frames (1 left out)")
        await pilot.press("down")
        assert view.job.name == "open/frame"
        page = await computed(app, pilot, view)
        assert any("frame_07.txt: the file is empty" in note for note in view.job.notes)
        await says(app, pilot, "open/frame: 3 panels")
        assert page.panels.rows[0][3] == "-"
        await pilot.press("down", "r")
        await says(app, pilot, "no panel found; nor any other flat surface")
        await sees(app, pilot, "cannot")
        assert app.state.selected["noise"] == "other/wall"
        (project / "hall/frame_00.txt").write_text("other\n")
        await pilot.press("home", "r")
        await says(app, pilot, "frame_00.txt")
        await until(pilot, lambda: view.page is None and view.running is None)

    drive(app_on(project), do)


def test_without_frames_it_says_what_it_needs(tmp_path):
    async def do(app, pilot):
        await pilot.press("f4")
        await sees(app, pilot, "no frames of panels: scans of one scene, numbered")
        await pilot.press("r")
        await says(app, pilot, "there is nothing to compute here")
        await pilot.press("n", "b", "v", "t", "n")
        await done(app, "next model")
        await says(app, pilot, "there is no model in the project")
        await pilot.press("f4", "f1")
        await until(pilot, lambda: isinstance(app.asking, Ask))
        await sees(app, pilot, "Frames of one hall with panels")

    drive(app_on(tmp_path), do)


def test_it_is_stopped(project, monkeypatch):
    begun, go = threading.Event(), threading.Event()

    def slow(hall, model, models, on_progress):
        begun.set()
        go.wait(60)
        on_progress(1, 2, "frames")
        raise AssertionError("nobody waits for it")

    monkeypatch.setattr(noise, "_page", slow)

    async def do(app, pilot):
        view = await on_noise(app, pilot)
        await pilot.press("r")
        await until(pilot, begun.is_set)
        await sees(app, pilot, "computing")
        await pilot.press("down", "r")
        await says(app, pilot, "hall/frame is being computed; x stops it")
        await pilot.press("x")
        go.set()
        await says(app, pilot, "hall/frame: stopped")
        assert view.running is None

    drive(app_on(project), do)


def test_a_computation_hears_that_nobody_waits(project):
    job = noise_jobs(read_project(project), "")[0]

    def on_progress(done, of, now):
        if now.startswith("simulated"):
            raise Cancelled

    with pytest.raises(Cancelled):
        job.compute(on_progress)


@pytest.mark.parametrize("size", [(80, 24), (160, 50)])
def test_any_size_can_be_had(project, size):
    async def do(app, pilot):
        view = await on_noise(app, pilot)
        await computed(app, pilot, view)
        for width, height in ((1, 1), (30, 8), (200, 3), (5, 60), size):
            await pilot.resize_terminal(width, height)
            await until(pilot, lambda width=width: app.size.width == width)
            await pilot.press("b", "n")
        await sees(app, pilot, "Panel")

    drive(app_on(project), do, size=size)
