"""The chooser finds anything by a few letters, and goes there; whatever is typed, it answers."""

import pytest

from lidarcheck.tui.chooser import Chooser, Opening, ranked
from lidarcheck.tui.openings import openings
from tui_kit import app_on, drive, make_project, on_blooming, sees, until


@pytest.fixture
def project(tmp_path):
    return make_project(tmp_path / "project")


def opening(kind, name, words=""):
    return Opening(kind, name, words, lambda: name)


def test_the_best_come_first_and_what_was_opened_last_before_its_equals():
    names = ["sign_157m.csv", "sign_69m.csv", "design.toml", "s_i_g_n.txt"]
    found = ranked([opening("measured", name) for name in names], ["sign"], [])
    assert [one.name for one in found][:2] == names[:2]
    assert found[-1].name == "s_i_g_n.txt"
    found = ranked([opening("measured", name) for name in names], ["sign", "69"], [])
    assert [one.name for one in found] == ["sign_69m.csv"]
    found = ranked([opening("measured", name) for name in names], [], ["measured design.toml", "measured gone"])
    assert found[0].name == "design.toml"
    assert not ranked([opening("measured", "abc")], ["cb"], [])


def test_letters_that_are_found_in_very_many_ways_are_found():
    chooser = Chooser([opening("measured", "ao" * 60)], [])
    for _ in range(30):
        chooser.typed.insert("o")
        chooser.changed()
    assert len(chooser.items) == 1
    chooser.typed.insert("ooo" * 200)
    chooser.changed()
    assert not chooser.items


def test_a_first_character_narrows_it_to_a_kind():
    all_of_them = [opening("measured", "a"), opening("model", "a"), opening("scenario", "a"), opening("action", "a")]
    for typed, kinds in (("", 4), ("@", 1), ("#", 1), ("%", 1), ("=", 1), (":", 1), ("@b", 0), ("a", 4)):
        assert len(Chooser(all_of_them, [], typed).items) == kinds, typed


def test_three_letters_and_enter_reach_everything(project):
    async def do(app, pilot):
        view = await on_blooming(app, pilot)

        async def opens(*keys):
            await pilot.press("o")
            await until(pilot, lambda: isinstance(app.asking, Chooser))
            await pilot.press("ctrl+u", *keys, "enter")
            await until(pilot, lambda: app.asking is None)

        await opens(*"157")
        await until(pilot, lambda: view.selection.current.name == "measured/sign_157m.csv")
        # Tab marks, also while other letters are looked for; Enter opens all that is marked.
        await opens(*"WID", "tab", "ctrl+u", "=", *"SMA", "tab")
        assert app.choice.of("feature") == "WIDTH"
        assert app.choice.of("model") == "models/SMART.toml"
        await opens(*"both")
        await until(pilot, lambda: view.file.path.name == "both_lut.ini")
        await opens(*"hori")
        await until(pilot, lambda: view.axis == "horizontal")
        await opens("number_sign", *"wea")
        await until(pilot, lambda: app.view.NAME == "overview")
        await opens("colon", *"log")
        await until(pilot, lambda: app.bars.log.has_class("shown"))
        await opens(*"zzzz")
        assert app.view.NAME == "overview"
        # All that the project has is offered, each once, and what was opened last comes first.
        offered = openings(app)
        keys = [one.key for one in offered]
        assert len(keys) == len(set(keys))
        for kind in (
            "measured",
            "model",
            "lut",
            "scenario",
            "golden",
            "feature",
            "effect",
            "action",
            "target",
            "table",
        ):
            assert any(one.kind == kind for one in offered), kind
        assert {one.name for one in offered if one.kind == "feature"} == {"AREA", "PEAK", "WIDTH", "range"}
        await pilot.press("o")
        assert app.asking.items[0].key == "action log"
        await sees(app, pilot, "show or hide the log")

    drive(app_on(project), do)
