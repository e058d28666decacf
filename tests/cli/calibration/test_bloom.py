"""`lidarcheck bloom`: from files to a fitted table, profiles, settings; and what is said of bad input."""

import json

import numpy as np
import pytest

from blooming_kit import lut_text, sign_frame, sign_model
from lidarcheck.cli import main
from lidarcheck.formats import save_ideal, save_scan
from lidarcheck.formats.lut import load_lut
from lidarcheck.model import load_model, save_model

PROFILE = "offset_spad_rows,range_m,PEAK,AREA,WIDTH_ns\n" + "".join(
    f"{x},156.6,{peak},{9 * peak if abs(x) > 8 else 2900},{width}\n"
    for x, peak, width in (
        (x, 236 if abs(x) < 8 else round(160 * np.exp(-abs(x) / 40)), 14) for x in range(-100, 101, 5)
    )
)


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A directory with a model, a table, a profile and a scan with its ideal scan."""
    monkeypatch.chdir(tmp_path)
    save_model(sign_model("SLIM"), "model.toml")
    (tmp_path / "lut.ini").write_text(lut_text())
    (tmp_path / "profile.csv").write_text(PROFILE)
    scan, ideal = sign_frame(156.6, "SLIM", 31)
    save_scan(scan, "scan.txt")
    save_ideal(ideal, "ideal.txt")
    return tmp_path


FIT = ("bloom", "fit", "profile.csv", "--model", "model.toml", "--lut", "lut.ini", "--out", "out")


def test_a_fit_writes_a_model_that_uses_its_table(place, capsys):
    assert main([*FIT, "--smoothness", "0.3"]) == 0
    assert "The vertical table fitted at 156.6 m" in capsys.readouterr().out
    result = json.loads((place / "out/result.json").read_text())["result"]
    table = load_lut(place / "out/lut.ini").tables["vertical"]
    assert [row["x"] for row in result["rows"]] == table.x.tolist()
    assert [row["y"] for row in result["rows"]] == pytest.approx(table.y.tolist(), abs=6e-8)
    effect = load_model(place / "out/model.toml").effects[0]
    assert effect.lut.y == tuple(table.y.tolist())
    assert (place / "lut.ini").read_text() == lut_text()
    assert (place / "out/report.html").exists()


def test_profiles_real_over_simulated(place, capsys):
    argv = ["bloom", "show", "scan.txt@156.6", "--ideal", "ideal.txt", "--model", "model.toml", "--lut", "lut.ini"]
    assert main([*argv, "--json", "-", "-q"]) == 0
    (profile,) = json.loads(capsys.readouterr().out)["result"]
    assert len(profile["real"]["offset"]) == len(profile["simulated"]["AREA"])
    assert np.max(profile["real"]["echoes"]) >= 3
    assert main(["bloom", "show", "scan.txt", "--simulated", "scan.txt", "--model", "model.toml", "-q"]) == 0
    out = capsys.readouterr().out
    assert "PEAK sim." in out
    assert "0.0" in out


def test_settings_say_where_to_look(place, capsys):
    name = "Blooming_Calibration_V_SLIM.json"
    for edit in ("156.6:SegHor=479", "156.6:IndexVerMin=768", "156.6:IndexVerMax=791"):
        assert main(["bloom", "settings", name, "--set", edit, "-q"]) == 0
    capsys.readouterr()
    argv = ["bloom", "show", "scan.txt", "--model", "model.toml", "--settings", ".", "--json", "-", "-q"]
    assert main(argv) == 0
    out = capsys.readouterr().out
    (profile,) = json.loads(out[out.index("{") :])["result"]
    assert np.max(profile["real"]["echoes"]) == 1
    assert main(["bloom", "settings", name, "--set", "156.6:SegHor=300", "-q"]) == 0
    assert main(argv) == 2
    assert "nothing saturates at 156.6 m where the setting says (column 300" in capsys.readouterr().err


def test_settings_from_defaults_to_undo(place, capsys):
    name = place / "Blooming_Calibration_H_SMART.json"
    assert main(["bloom", "settings", str(name)]) == 0
    assert "horizontal" in capsys.readouterr().out
    assert not name.exists()
    assert main(["bloom", "settings", str(name), "--defaults", "-q"]) == 0
    first = name.read_bytes()
    assert main(["bloom", "settings", str(name), "--set", "35:SegVer=250", "-q"]) == 0
    assert json.loads(name.read_text())[1] == json.loads(first)[0] | {"Distance": 35.0, "SegVer": 250}
    assert name.with_name(name.name + ".undo").read_bytes() == first
    assert main(["bloom", "settings", str(name), "--remove", "35", "-q"]) == 0
    assert json.loads(name.read_text()) == json.loads(first)
    for argv, what in (
        (["--set", "20:SegVr=1"], "did you mean SegVer?"),
        (["--set", "20:SegVer=520"], "519"),
        (["--set", "20"], "write DISTANCE:KEY=VALUE"),
        (["--set", "x:SegVer=1"], "DISTANCE is in metres"),
        (["--remove", "3"], "there is no setting for 3 m; there are: 20"),
    ):
        assert main(["bloom", "settings", str(name), *argv, "-q"]) == 2
        assert what in capsys.readouterr().err
    assert json.loads(name.read_text()) == json.loads(first)


@pytest.mark.parametrize(
    ("argv", "what"),
    [
        (("--smoothness", "0"), "--smoothness 0 is out of range"),
        (("--free", "gain"), "--free gain cannot be fitted; use pulse, tail, brightness"),
        (("--axis", "horizontal"), "is a vertical profile; horizontal ones are asked for"),
        (("--target", "2"), "material 2 is no retro-reflector of the model; there are: 7"),
        (("--signal", "-1"), "--signal -1 is out of range"),
        (("--reach", "5"), "--reach 5 is no range; write LOW:HIGH"),
        (("--ideal", "a", "--ideal", "b"), "1 scans and 2 ideal scans"),
        (("--settings", "Blooming_Calibration_V_SMART.json"), "are settings of SMART, the model is SLIM"),
    ],
)
def test_what_a_fit_refuses(place, argv, what, capsys):
    assert main([*FIT, *argv]) == 2
    assert what in capsys.readouterr().err
    assert not (place / "out").exists()


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        ("\n20,156.6,", "\ntwenty,156.6,", "profile.csv:26: 'twenty' is not a number"),
        (",236,2900,", ",100,900,", "no PEAK or AREA saturates"),
        (",156.6,", ",,", "has no ranges; name the distance as PROFILE@DISTANCE"),
        ("PEAK,AREA,WIDTH_ns", "A,B,C", "has no PEAK, AREA or WIDTH"),
    ],
)
def test_profiles_that_are_refused(place, old, new, what, capsys):
    (place / "profile.csv").write_text(PROFILE.replace(old, new))
    assert main(list(FIT)) == 2
    assert what in capsys.readouterr().err


def test_a_profile_that_is_cut(place, capsys):
    lines = PROFILE.splitlines(keepends=True)
    (place / "profile.csv").write_text("".join(lines[:1] + lines[21:]))
    assert main(list(FIT)) == 2
    assert "the target is cut by the end of the profile" in capsys.readouterr().err


def test_the_table_is_not_replaced(place, capsys):
    assert main([*FIT[:-1], "."]) == 2
    assert "is the directory of --lut" in capsys.readouterr().err
    assert (place / "lut.ini").read_text() == lut_text()


def test_simulated_scans_of_another_distance_are_refused(place, capsys):
    far, _ = sign_frame(199.0, "SLIM", 32)
    save_scan(far, "far.txt")
    argv = ["bloom", "show", "scan.txt", "--simulated", "far.txt", "--model", "model.toml", "-q"]
    assert main(argv) == 2
    err = capsys.readouterr().err
    assert err == (
        "error: far.txt: its target is at 198.5 m, that of scan.txt at 156.2 m; "
        "give one --simulated for each scan, in their order\n"
    )


def test_a_simulated_scan_of_other_layers_is_shown_beside(place, capsys):
    """Fewer beams are no reason against it: the offsets that both have are compared."""
    scan, _ = sign_frame(156.6, "SLIM", 31)
    save_scan(scan.take(scan.layer >= 200), "fewer.txt")
    argv = ["bloom", "show", "scan.txt", "--simulated", "fewer.txt", "--model", "model.toml", "--plot", "histogram"]
    assert main([*argv, "-q"]) == 0
    assert "range at 156.2 m" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("variant", "ideal", "what"),
    [
        ("SLIM", (), "above the 135 at which the model's sensor, SMART, saturates"),
        ("SMART", ("--ideal", "other_ideal.txt"), "that is how SMART saturates, not SLIM at 236"),
    ],
)
def test_a_scan_of_the_other_variant_is_refused(place, variant, ideal, what, capsys):
    """An ideal scan says how bright the target is, and so the fit would not notice by itself."""
    scan, meets = sign_frame(156.6, variant, 33)
    save_scan(scan, "other.txt")
    save_ideal(meets, "other_ideal.txt")
    save_model(sign_model("SMART" if variant == "SLIM" else "SLIM"), "model.toml")
    argv = ["bloom", "fit", "other.txt", *ideal, "--model", "model.toml", "--lut", "lut.ini", "--out", "out", "-q"]
    assert main(argv) == 2
    assert what in capsys.readouterr().err
    assert not (place / "out").exists()


def test_a_profile_of_the_other_variant_is_refused(place, capsys):
    save_model(sign_model("SMART"), "model.toml")
    assert main(list(FIT)) == 2
    assert "profile.csv: PEAK reaches 236, above the 135 at which SMART saturates" in capsys.readouterr().err


def test_a_scan_counts_once(place, capsys):
    assert main(["bloom", "fit", "scan.txt", "./scan.txt", *FIT[3:]]) == 2
    assert capsys.readouterr().err == "error: scan.txt is named twice; name each file once\n"


def test_a_fit_that_does_not_hold_says_so(place, capsys):
    text = PROFILE.replace("160 *", "")
    wide = text.splitlines(keepends=True)
    rows = [",".join([*line.split(",")[:4], "40\n"]) for line in wide[1:]]
    (place / "profile.csv").write_text("".join([wide[0], *rows]))
    assert main([*FIT, "--smoothness", "0.3"]) == 0
    assert "The model does not show what was measured" in capsys.readouterr().out


def test_an_interrupt_while_the_pictures_are_drawn_leaves_nothing(place, monkeypatch, capsys):
    """The table and the model are made before the pictures, beside the place they go to, and gone with them."""

    def interrupted(*_args, **_how):
        assert len([*place.rglob("model.toml")]) == 2
        raise KeyboardInterrupt

    monkeypatch.setattr("lidarcheck.figures.files.pictures.save_figure", interrupted)
    assert main([*FIT, "--smoothness", "0.3", "-q"]) == 130
    assert not (place / "out").exists()
    assert len([*place.rglob("model.toml")]) == 1


def test_a_model_in_the_output_directory_is_not_replaced(place, capsys):
    (place / "out").mkdir()
    save_model(sign_model("SLIM"), "out/model.toml")
    before = (place / "out/model.toml").read_bytes()
    argv = ["bloom", "fit", "profile.csv", "--model", "out/model.toml", "--lut", "lut.ini", "--out", "out"]
    assert main(argv) == 2
    assert "out/model.toml: would replace a file of this command" in capsys.readouterr().err
    assert (place / "out/model.toml").read_bytes() == before


def test_settings_are_checked_without_writing_too(place, capsys):
    name = "Blooming_Calibration_V_SLIM.json"
    assert main(["bloom", "settings", name, "--set", "69:SegHor=9999", "--dry-run"]) == 2
    assert "SegHor = 9999 is out of range" in capsys.readouterr().err
    assert main(["bloom", "settings", name, "--set", "-5:SegHor=400"]) == 2
    assert "Distance = -5" in capsys.readouterr().err
    assert not (place / name).exists()
    both = ["--set", "69:IndexVerMin=900", "--set", "69:IndexVerMax=950"]
    assert main(["bloom", "settings", name, *both, "-q"]) == 0
    assert json.loads((place / name).read_text())[0]["IndexVerMax"] == 950
    (place / name).write_text("[]")
    assert main(["bloom", "settings", name]) == 0
    assert "no distance has settings" in capsys.readouterr().out


def test_ideal_scans_are_named_behind_one_option(place, capsys):
    far, meets = sign_frame(199.0, "SLIM", 32)
    save_scan(far, "far.txt")
    save_ideal(meets, "far_ideal.txt")
    show = ["bloom", "show", "scan.txt", "far.txt", "--model", "model.toml", "--json", "-", "-q"]
    for ideals in (["--ideal", "ideal.txt", "far_ideal.txt"], ["--ideal", "ideal.txt", "--ideal", "far_ideal.txt"]):
        assert main([*show, *ideals]) == 0
        found = json.loads(capsys.readouterr().out)["result"]
        assert [round(one["distance_m"]) for one in found] == [157, 199]


@pytest.mark.parametrize("option", [("--signal", "1e8"), ("--settings", ".")])
def test_two_ways_to_say_where_the_target_is_are_refused(place, option, capsys):
    argv = ["scan.txt", "--ideal", "ideal.txt", "--model", "model.toml", *option]
    assert main(["bloom", "show", *argv]) == 2
    assert f"{option[0]} stands beside --ideal" in capsys.readouterr().err
    assert main(["bloom", "fit", *argv, "--lut", "lut.ini", "--out", "out"]) == 2
    assert f"{option[0]} stands beside --ideal" in capsys.readouterr().err


def test_brightness_needs_a_target_that_is_known(place, capsys):
    text = (place / "model.toml").read_text()
    more = '\n[materials.20]\nname = "stud"\nreflectance = 0.5\nkind = "retro"\nretro_gain = 500.0\n'
    (place / "model.toml").write_text(text + more)
    argv = ["bloom", "fit", "scan.txt", "--ideal", "ideal.txt", "--free", "brightness", *FIT[3:]]
    assert main(argv) == 2
    assert "--free brightness does not say of which retro-reflector; name it with --target" in capsys.readouterr().err


def test_a_target_alone_in_a_scan_may_not_be_cut(place, capsys):
    scan, _ = sign_frame(69.0, "SLIM", 34)
    save_scan(scan.take(scan.area > 3200), "alone.txt")
    assert main(["bloom", "show", "alone.txt", "--model", "model.toml", "-q"]) == 2
    err = capsys.readouterr().err
    assert "the target is cut by the end of the scan" in err
    assert "--ideal says which beams were fired" in err
