"""The maps of Cloud, driven by keys on a small bench: measured frames beside a model's, with its effects on and off."""

from pathlib import Path

import pytest

from bench_kit import make_bench
from lidarcheck.cli import main
from lidarcheck.effects import catalogue
from lidarcheck.model import load_model
from lidarcheck.session.state import load_state
from lidarcheck.tui.app import LidarcheckApp
from lidarcheck.tui.jobs.scenes import Effects, offers_of
from lidarcheck.tui.screens.cloud.screen import Cloud
from lidarcheck.tui.widgets.choose import Choose
from lidarcheck.tui.widgets.lines import Lines
from tui_kit import apart_from_key, as_stored, done, drive, says, sees, text_of, until

STREET = "scenes/SMART_real_street.pcd"


@pytest.fixture
def bench(tmp_path):
    root = make_bench(tmp_path / "bench")
    (root / "scenes/real_street.pcd").rename(root / "scenes/SMART_real_street.pcd")
    return root


@pytest.fixture
def inside(bench, monkeypatch):
    monkeypatch.chdir(bench)
    return Path()


def scenes(project, do, size=(80, 24)):
    async def on_it(app, pilot):
        await until(pilot, lambda: isinstance(app.view, Cloud) and app.view.listed)
        app.view.show_maps(True)
        await until(pilot, lambda: app.focused is app.view.query_one("#jobs") and app.view.running is None)
        await do(app, pilot, app.view)

    drive(LidarcheckApp(project, screen="cloud"), on_it, size)


async def computed(pilot, view):
    await pilot.press("r")
    await until(pilot, lambda: view.running is None and view.page is not None, lambda: view.state)


async def effects_of(app, pilot):
    await pilot.press("E")
    await until(pilot, lambda: isinstance(app.asking, Choose))
    await sees(app, pilot, "Space on or off")
    return app.asking


async def at_effect(pilot, dialog, name):
    """Move the cursor of the list to an effect."""
    names = [switch.name for switch in dialog.switches]
    await pilot.press("home", *["down"] * names.index(name))
    await until(pilot, lambda: dialog.line == names.index(name))


async def on_frame(pilot, view, name):
    """Move the cursor to a frame."""
    names = [job.name for job in view.listed]
    await pilot.press("home", *["down"] * names.index(name))
    await until(pilot, lambda: view.job.name == name)


def shown(view, pane):
    return view.query_one(f"#{pane}", Lines).text


def test_where_it_disagrees_comes_first(bench):
    async def do(app, pilot, view):
        assert [bool(job.fault) for job in view.listed] == sorted(bool(job.fault) for job in view.listed)
        faults = {job.name: job.fault for job in view.listed if job.fault}
        assert faults["truck_16m_SMART_real.pcd"].startswith("no ideal scan is named like it: ideal_truck_16m_SMART")
        assert "the file is empty" in faults["empty.txt"]
        assert not any("sim" in job.name for job in view.listed)
        await computed(pilot, view)
        await says(app, pilot, "disagree in one place; most: 100 % fewer echoes in layer 240")
        await sees(app, pilot, "Echoes, measured min")
        await sees(app, pilot, "AREA, measured over simu")
        await pilot.press("right")
        await sees(app, pilot, "Range, measured min")
        await pilot.press("right")
        await sees(app, pilot, "Where they disagree most: from above")
        await pilot.press("right")
        await sees(app, pilot, "Beams with an echo from their surface")
        words = shown(view, "words")
        order = [words.index(part) for part in ("1. 100 % fewer", "Chamfer", "By object", "By sector", "azimuth [deg]")]
        assert order == sorted(order)
        assert "object 2 " in words
        await pilot.press("t")
        await sees(app, pilot, "1. 100 % fewer echoes in layer 240")

    scenes(bench, do)


def test_a_model_is_chosen_and_kept(bench):
    async def do(app, pilot, view):
        assert view.job.words == "ideal_street.parquet, models/SMART.toml"
        await done(app, "next model")
        await says(app, pilot, "model: models/SMART.toml (1 of 1)")  # SLIM's is not meant for it
        van = next(job for job in view.listed if "van" in job.name)
        assert van.words.endswith("models/SLIM.toml")
        (bench / "models/SMART.toml").unlink()
        await pilot.press("r")
        await says(app, pilot, "SMART.toml")
        await until(pilot, lambda: view.running is None)

    async def again(app, pilot, view):
        assert view.job.words == "ideal_street.parquet, models/SLIM.toml"

    scenes(bench, do)
    scenes(bench, again)


def test_effects_are_switched_and_pages_kept(bench):
    async def do(app, pilot, view):
        await computed(pilot, view)
        worker, plain = view.worker, view.page
        dialog = await effects_of(app, pilot)
        await sees(app, pilot, "[ ] afterpulsing               with typical parameters")
        await at_effect(pilot, dialog, "fog")
        await pilot.press("space")
        await sees(app, pilot, "[x] fog")
        await pilot.press("a")
        await sees(app, pilot, "[ ] fog")
        await pilot.press("space", "escape")
        await until(pilot, lambda: not isinstance(app.asking, Choose))
        assert view.page is plain
        dialog = await effects_of(app, pilot)
        await at_effect(pilot, dialog, "signal_gain")
        await pilot.press("space", "end", "pageup", "enter")
        await says(app, pilot, "models/SMART.toml with signal_gain")
        await sees(app, pilot, "not computed yet")
        assert view.job.words == "ideal_street.parquet, models/SMART.toml with signal_gain"
        await computed(pilot, view)
        assert view.page is not plain
        assert "effects: signal_gain, seed 0" in view.page.provenance["model"]
        assert view.worker is not worker
        await done(app, "own effects")
        await says(app, pilot, "models/SMART.toml, as its file says")
        await until(pilot, lambda: view.page is plain)
        dialog = await effects_of(app, pilot)
        await at_effect(pilot, dialog, "fog")
        await pilot.press("space", "enter")
        await says(app, pilot, "models/SMART.toml with fog")

    async def again(app, pilot, view):
        assert view.job.words.endswith("models/SMART.toml with fog")

    scenes(bench, do)
    assert load_state(bench).selected["effects models/SMART.toml"] == "+fog"
    scenes(bench, again)


def test_the_export_is_what_the_command_writes(inside, capsys):
    text = Path("models/SMART.toml").read_text()
    Path("models/SMART.toml").write_text(f'{text}\n[[effects]]\nname = "fog"\n\n[[effects]]\nname = "rain"\n')

    async def do(app, pilot, view):
        dialog = await effects_of(app, pilot)
        await sees(app, pilot, "[x] fog                        in the model")
        await at_effect(pilot, dialog, "fog")
        await pilot.press("space")
        await at_effect(pilot, dialog, "rain")
        await pilot.press("space")
        await at_effect(pilot, dialog, "signal_gain")
        await pilot.press("space", "enter")
        await says(app, pilot, "without fog, rain with signal_gain")
        await computed(pilot, view)
        await pilot.press("e")
        await sees(app, pilot, "to which directory")
        await pilot.press("ctrl+u", *"by_key", "enter")
        await says(app, pilot, "by_key: report.html, result.json, pictures/")

    scenes(inside, do)
    files = ("scenes/SMART_real_street.pcd", "--ideal", "scenes/ideal_street.parquet", "--model", "models/SMART.toml")
    assert main(["scenes", "compare", *files, "--effects", "signal_gain", "--out", "by_command"]) == 0
    # The same files, computed from the same files.
    assert apart_from_key(Path("by_command")) == apart_from_key(Path("by_key"))


def test_a_choice_of_effects_is_read_as_it_was_kept(bench):
    effects = Effects.of("-fog +rain +nonsense other")
    assert effects == Effects(("fog",), ("rain",))
    assert Effects.of(effects.text()) == effects
    assert effects.words() == " without fog with rain"
    model = load_model(bench / "models/SMART.toml")
    assert Effects(("fog",)).applied(model) is model
    with_both = Effects((), ("rain", "fog")).applied(model)
    assert {effect.name for effect in with_both.effects} == {"rain", "fog"}
    assert [effect.name for effect in effects.applied(with_both).effects] == ["rain"]
    offers = offers_of(with_both, Effects(("fog",), ("walk_error",)))
    assert sorted(offer.name for offer in offers) == sorted(catalogue())
    assert {offer.name for offer in offers if offer.on} == {"rain", "walk_error"}
    assert [offer.words for offer in offers][:3] == ["in the model", "in the model", "with typical parameters"]


def test_around_a_program_what_it_cannot_have_says_why():
    from lidarcheck.config.schema import LineIndex
    from lidarcheck.model.files.model_file import model_of

    model = model_of({"external": {"command": ["true", "{ideal}", "{scan}"]}}, LineIndex(Path("model.toml")))
    offers = {offer.name: offer for offer in offers_of(model, Effects())}
    inside = [offer.words for offer in offers.values() if not offer.able]
    assert "it acts inside the program, and no number of [external.parameters] stands for it" in inside
    assert offers["dropout"].able


def test_a_model_that_is_none_says_so(bench):
    (bench / "models/SLIM.toml").unlink()

    async def do(app, pilot, view):
        (bench / "models/SMART.toml").write_text("variant = 7\n")
        await pilot.press("E")
        await says(app, pilot, "models/SMART.toml")

    scenes(bench, do)


def test_a_project_without_models_or_frames_says_so(tmp_path, bench):
    for model in (bench / "models").iterdir():
        model.unlink()

    async def without(app, pilot, view):
        await on_frame(pilot, view, STREET)
        await sees(app, pilot, f"{STREET} cannot be computed: there is no model")
        for name in ("next model", "settings", "renew"):
            app.say("")
            await done(app, name)
            await says(app, pilot, "there is no model in this project")

    async def empty(app, pilot):
        await sees(app, pilot, "ideal_street.pcd")
        await pilot.press("r", "n", "v", "t", "e", "down", "plus", "b", "w", "E")
        await says(app, pilot, "no model")

    scenes(bench, without)
    (tmp_path / "empty").mkdir()
    drive(LidarcheckApp(tmp_path / "empty", screen="cloud"), empty)


def test_any_size_down_to_one_by_one(bench):
    async def do(app, pilot, view):
        await computed(pilot, view)
        for size in ((1, 1), (5, 3), (40, 10), (200, 60), (3, 40), (80, 24)):
            await pilot.resize_terminal(*size)
            await pilot.press("right", "t", "E", "down", "space", "escape")
            await pilot.pause()
        await sees(app, pilot, "? Help")
        await until(pilot, lambda: "F7 Cloud" in text_of(app))

    scenes(bench, do)


@pytest.mark.parametrize("size", [(80, 24), (160, 50)])
def test_snapshots(bench, size):
    async def do(app, pilot, view):
        await computed(pilot, view)
        await as_stored(app, pilot, f"scenes_{size[0]}x{size[1]}")

    scenes(bench, do, size)
