"""Reading a case: what fits is read, what does not is refused in one line before anything is fitted."""

import logging
import shutil
from dataclasses import replace

import numpy as np
import pytest

from explain_kit import ideal_scan, write_case
from lidarcheck.beams import Fired
from lidarcheck.cases.case import load_case
from lidarcheck.cli import main
from lidarcheck.errors import LidarcheckError
from lidarcheck.formats import load_ideal, load_scan, save_ideal, save_scan


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    return write_case(tmp_path_factory.mktemp("good") / "case", frames=6)


@pytest.fixture
def case(good, tmp_path):
    return shutil.copytree(good, tmp_path / "case")


def edit(file, old, new, count=1):
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new, count))


def refusal(place):
    with pytest.raises(LidarcheckError) as caught:
        load_case(place)
    lines = caught.value.lines()
    assert all("\n" not in line and line.startswith("error: ") for line in lines)
    return "\n".join(lines)


def test_a_case_is_read(case):
    loaded = load_case(case)
    assert [frame.number for frame in loaded.frames] == list(range(6))
    assert [frame.time_s for frame in loaded.frames] == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4, 0.5])
    assert len(loaded.frames[2].ideal) == 600
    assert loaded.left_out == {}
    assert loaded.model.sensor.variant == "SMART"
    assert loaded.model_file == case / "model.toml"
    assert set(loaded.hashes) == {"case.toml", "model.toml", *(f"{a}{k}.txt" for a in "im" for k in range(6))}
    assert all(path.is_file() for path in loaded.files)


def test_frames_of_a_recording_are_measured_frames_of_a_case(case):
    (case / "measured").mkdir()
    for k in range(6):
        shutil.move(case / f"m{k}.txt", case / "measured" / f"m{k}.txt")
    assert main(["convert", str(case / "measured"), str(case / "drive.bag"), "--quiet"]) == 0
    scan = load_scan(case / "measured/m2.txt")
    shutil.rmtree(case / "measured")
    for k in range(6):
        edit(case / "case.toml", f'"m{k}.txt"', f'"drive.bag#/points@{k}"')
    loaded = load_case(case)
    assert loaded.left_out == {}
    assert {"drive.bag", "i2.txt"} < set(loaded.hashes)
    assert len(loaded.hashes) == 9
    measured = loaded.frames[2].measured
    assert np.array_equal(measured.range_m, scan.range_m)
    assert np.array_equal(measured.area, scan.area)
    assert np.array_equal(measured.layer, scan.layer)


def test_the_file_itself_will_do(case):
    assert len(load_case(case / "case.toml").frames) == 6


def test_one_changed_byte_changes_one_hash(case):
    before = load_case(case).hashes
    edit(case / "model.toml", "bench", "BENCH")
    after = load_case(case).hashes
    assert [name for name in before if before[name] != after[name]] == ["model.toml"]


def test_no_case(tmp_path, case):
    assert "the directory has no case.toml; write case.toml" in refusal(tmp_path)
    assert "there is no such file" in refusal(tmp_path / "nowhere")
    assert "is not a case; name a directory that holds case.toml" in refusal(case / "m0.txt")


CONFIG = {
    "unknown key": ("time = 0.1", "time = 0.1\nspeed = 3", "case.toml:12: unknown key frames[1].speed"),
    "missing key": ("time = 0.1\n", "", "frames[1].time is missing"),
    "not finite": ("time = 0.1", "time = nan", "frames[1].time = nan"),
    "text": ("time = 0.1", 'time = "soon"', "frames[1].time = "),
    "outside": ('"m1.txt"', '"../m1.txt"', "case.toml:10: measured = '../m1.txt' leads out of the case's directory"),
    "outside by a detour": ('"m1.txt"', '"a/../../m1.txt"', "leads out of the case's directory"),
    "absolute": ('"i1.txt"', '"/tmp/i1.txt"', "leads out of the case's directory"),
    "model outside": ('"model.toml"', '"../model.toml"', "case.toml:1: model = '../model.toml' leads out"),
    "twice": ('"m1.txt"', '"m0.txt"', "case.toml:10: frame 1 names m0.txt as measured, as frame 0 does"),
    "twice by a detour": ('"m1.txt"', '"./m0.txt"', "frame 1 names m0.txt as measured, as frame 0 does"),
    "both": ('"m1.txt"', '"i1.txt"', "frame 1 names i1.txt both as ideal and as measured"),
    "no model": ('"model.toml"', '"other.toml"', "other.toml: there is no such file"),
}


@pytest.mark.parametrize(("old", "new", "says"), CONFIG.values(), ids=CONFIG)
def test_a_fault_of_the_case_file(case, old, new, says):
    edit(case / "case.toml", old, new)
    assert says in refusal(case)


def test_too_few_frames(tmp_path):
    write_case(tmp_path / "two", frames=2)
    assert "case.toml:3: the case has 2 frames, too few frames to split; measure 3 or more" in refusal(tmp_path / "two")
    (tmp_path / "two/case.toml").write_text('model = "model.toml"\n')
    assert "the case has no frames, too few frames to split" in refusal(tmp_path / "two")


def test_a_copy_is_no_measurement(case):
    shutil.copy(case / "m3.txt", case / "m4.txt")
    assert "case.toml:25: frame 4: m4.txt holds the same bytes as m3.txt of frame 3" in refusal(case)


def test_a_program_that_nobody_trusts(case):
    (case / "run").write_text("#!/bin/sh\n")
    (case / "run").chmod(0o755)
    with (case / "model.toml").open("a") as model:
        model.write('\n[external]\ncommand = ["./run", "{ideal}", "{scan}"]\n')
    assert "runs a program that you do not trust: ./run" in refusal(case)


def test_a_material_without_an_entry(case):
    edit(case / "model.toml", "[materials.2]", "[materials.7]")
    line = refusal(case)
    assert "material 2 is not in the table of materials" in line
    assert "i0.txt" in line
    assert "Layer 251, Point 470" in line


def test_a_fault_of_the_model_keeps_its_line(case):
    edit(case / "model.toml", "reflectance = 0.5", "reflectance = 1.5")
    assert "model.toml:6: materials.1.reflectance = 1.5 is out of range" in refusal(case)


def damaged(case, caplog):
    caplog.set_level(logging.WARNING)
    loaded = load_case(case)
    said = [r.getMessage() for r in caplog.records if "is left out" in r.getMessage()]
    assert len(said) == len(loaded.left_out) == 6 - len(loaded.frames)
    return loaded


def cut_rows(file, keep):
    """The file's first rows, with a count line that agrees: as if the export had ended early."""
    lines = file.read_text().splitlines()
    file.write_text("\n".join([lines[0], str(keep), *lines[2 : 2 + keep]]) + "\n")


def with_cell(file, row, column, text):
    """The file with another cell."""
    lines = file.read_text().splitlines()
    cells = lines[row].split()
    cells[column] = text
    file.write_text("\n".join([*lines[:row], " ".join(cells), *lines[row + 1 :]]) + "\n")


DAMAGE = {
    "gone": (lambda f: f.unlink(), "m2.txt: there is no such file"),
    "empty": (lambda f: f.write_text(""), "m2.txt: the file is empty"),
    "no rows": (lambda f: cut_rows(f, 0), "m2.txt: "),
    "binary": (lambda f: f.write_bytes(bytes(range(256)) * 9), "m2.txt"),
    "cut within a row": (lambda f: f.write_text(f.read_text()[:-30]), "m2.txt"),
    "cut between rows": (lambda f: cut_rows(f, 200), "m2.txt: ends at Layer "),
    "NaN": (lambda f: with_cell(f, 6, 4, "nan"), "m2.txt:7: AREA is nan"),
    "text": (lambda f: edit(f, f.read_text().splitlines()[6].split()[0], "abc"), "m2.txt:7: "),
}


@pytest.mark.parametrize(("harm", "says"), DAMAGE.values(), ids=DAMAGE)
def test_one_damaged_frame_is_left_out(case, harm, says, caplog):
    harm(case / "m2.txt")
    loaded = damaged(case, caplog)
    assert [frame.number for frame in loaded.frames] == [0, 1, 3, 4, 5]
    assert list(loaded.left_out) == ["frame 2"]
    assert loaded.left_out["frame 2"].startswith(says)


def test_a_row_without_a_return_is_no_damage(case, caplog):
    with_cell(case / "m2.txt", 6, 0, "nan")
    loaded = damaged(case, caplog)
    assert not loaded.left_out
    assert len(loaded.frames[2].measured) == len(load_scan(case / "m2.txt"))
    assert len(loaded.frames[2].ideal) == len(load_ideal(case / "i2.txt"))


def test_beams_that_were_not_fired_are_not_judged(case):
    measured, ideal = load_scan(case / "m2.txt"), load_ideal(case / "i2.txt")
    fired = ideal.point != ideal.point.max()
    kept = measured.take(measured.point != ideal.point.max())
    save_scan(replace(kept, fired=Fired(ideal.layer[fired], ideal.point[fired])), case / "m2.txt")
    frame = load_case(case).frames[2]
    assert len(frame.ideal) == np.count_nonzero(fired)
    assert len(frame.measured) == len(kept)


def test_a_frame_with_other_beams_is_left_out(case, caplog):
    save_ideal(ideal_scan(2, layers=range(100, 120)), case / "i2.txt")
    assert "600 echoes" not in damaged(case, caplog).left_out["frame 2"]
    assert "echoes are on beams that i2.txt does not have, the first on Layer 2" in caplog.text


def test_other_beams_in_all_frames(case):
    for k in range(6):
        save_ideal(ideal_scan(k, layers=range(100, 120)), case / f"i{k}.txt")
    line = refusal(case)
    assert "m0.txt: all echoes are on beams that i0.txt does not have" in line
    assert "(and so all 6 frames); name the ideal scan of the same frame" in line


def test_another_scene_in_all_frames(case):
    for k in range(6):
        ideal = load_ideal(case / f"i{k}.txt")
        near = type(ideal)(ideal.layer, ideal.point, ideal.distance_m / 2, ideal.material_id, ideal.incidence_deg)
        save_ideal(near, case / f"i{k}.txt")
    assert "m0.txt: only 0 % of the beams with echoes have one from the surface that i0.txt has" in refusal(case)


def test_dense_fog_is_no_other_scene(case):
    """Nearly all echoes come from the air before the surfaces: an effect of the catalogue does that."""
    for k in range(6):
        scan = load_scan(case / f"m{k}.txt")
        near = np.where(np.arange(len(scan)) % 9 == 0, 1.0, 3.0 / scan.range_m)
        xyz = (column * near for column in (scan.x_m, scan.y_m, scan.z_m))
        rest = (scan.layer, scan.point, scan.echo_number, scan.width_ns, scan.area, scan.peak)
        save_scan(type(scan)(*xyz, *rest), case / f"m{k}.txt")
    assert len(load_case(case).frames) == 6


def test_more_than_a_third_damaged(case):
    for k in (1, 3, 4):
        (case / f"m{k}.txt").write_text("")
    assert "m1.txt: the file is empty (3 of 6 frames cannot be used); was it written completely?" in refusal(case)


def test_a_third_may_be_damaged(case, caplog):
    for k in (1, 3):
        (case / f"m{k}.txt").write_text("")
    assert list(damaged(case, caplog).left_out) == ["frame 1", "frame 3"]


def test_too_few_frames_remain(tmp_path):
    case = write_case(tmp_path / "c", frames=3)
    (case / "m1.txt").write_text("")
    assert "m1.txt: the file is empty (without it 2 frames are left, too few frames to split" in refusal(case)


@pytest.mark.parametrize("order", [(1, 0, 2, 3, 4, 5), (0, 1, 2, 4, 5, 3), (5, 4, 3, 2, 1, 0)])
def test_swapped_files(case, order):
    for k in range(6):
        (case / f"m{k}.txt").rename(case / f"old{k}.txt")
    for k, source in enumerate(order):
        (case / f"old{source}.txt").rename(case / f"m{k}.txt")
    first = next(k for k in range(6) if order[k] != k)
    assert f"m{first}.txt fits i{order[first]}.txt of frame {order[first]} better than i{first}.txt" in refusal(case)


@pytest.mark.parametrize("offset_m", [-0.6, 1.1])
def test_an_offset_of_all_ranges_is_not_taken_for_a_swap(case, offset_m):
    for k in range(6):
        scan = load_scan(case / f"m{k}.txt")
        more = 1.0 + offset_m / scan.range_m
        moved = type(scan)(
            scan.x_m * more, scan.y_m * more, scan.z_m * more, scan.layer, scan.point, scan.echo_number,
            scan.width_ns, scan.area, scan.peak,
        )  # fmt: skip
        save_scan(moved, case / f"m{k}.txt")
    assert len(load_case(case).frames) == 6
    for a, b in (("m0", "t"), ("m1", "m0"), ("t", "m1")):
        (case / f"{a}.txt").rename(case / f"{b}.txt")
    assert "m0.txt fits i1.txt" in refusal(case)


def test_ideal_and_measured_exchanged(case):
    edit(case / "case.toml", 'ideal = "i1.txt"\nmeasured = "m1.txt"', 'ideal = "m1.txt"\nmeasured = "i1.txt"')
    line = refusal(case)
    assert "case.toml:9: frame 1: m1.txt holds echoes and i1.txt an ideal scan; exchange" in line


def test_smart_model_on_slim_data(tmp_path):
    case = write_case(tmp_path / "c", variant="SMART", measured_by="SLIM")
    line = refusal(case)
    assert "m0.txt: PEAK reaches 236" in line
    assert "above the 135 at which the model's sensor, SMART, saturates" in line
    assert "name the model of the variant that measured, SLIM?" in line


def test_slim_model_on_smart_data(tmp_path):
    case = write_case(tmp_path / "c", variant="SLIM", measured_by="SMART")
    line = refusal(case)
    assert "model.toml:2: no PEAK is above 135, where " in line
    assert "that is how SMART saturates, not SLIM at 236" in line


def test_weak_echoes_alone_do_not_tell_the_variant(case):
    edit(case / "model.toml", "SMART", "SLIM")
    for k in range(6):
        scan = load_scan(case / f"m{k}.txt")
        save_scan(scan.take(scan.peak < 120), case / f"m{k}.txt")
    assert len(load_case(case).frames) == 6


@pytest.mark.parametrize("name", ["PEAK", "AREA", "WIDTH"])
def test_missing_features(case, name):
    for k in range(6):
        scan = load_scan(case / f"m{k}.txt")
        field = {"PEAK": "peak", "AREA": "area", "WIDTH": "width_ns"}[name]
        columns = {f: getattr(scan, f) for f in ("x_m", "y_m", "z_m", "layer", "point", "echo_number")}
        features = {f: getattr(scan, f) for f in ("width_ns", "area", "peak")} | {field: np.zeros(len(scan))}
        save_scan(type(scan)(**columns, **features, defaulted=(name,)), case / f"m{k}.txt")
    assert f"m0.txt: no column {name}: " in refusal(case)


def test_beams_are_found_by_position(case, caplog):
    """Without Layer and Point; two echoes that lie in no beam's direction are told and left out."""
    caplog.set_level(logging.WARNING)
    for k in range(6):
        lines = (case / f"m{k}.txt").read_text().splitlines()
        names = lines[0].lstrip("/").split()
        keep = [i for i, name in enumerate(names) if name not in ("Layer", "Point")]
        rows = [" ".join(line.split()[i] for i in keep) for line in [" ".join(names), *lines[2:]]]
        extra = [rows[1].split(), rows[1].split()]
        extra[0][names.index("X")] = "-9.0"
        rows += [" ".join(extra[0])] * 2 if k == 1 else []
        (case / f"m{k}.txt").write_text("\n".join(rows) + "\n")
    loaded = load_case(case)
    assert len(loaded.frames) == 6
    assert f"m1.txt: 2 of {len(loaded.frames[1].measured) + 2} echoes lie in the direction of no beam" in caplog.text


def test_odd_text_and_other_formats_work(case):
    text = (case / "m0.txt").read_text().replace("\n", "\r\n")
    (case / "m0.txt").write_bytes(b"\xef\xbb\xbf" + text.encode() + b"\r\n\r\n")
    (case / "case.toml").write_bytes((case / "case.toml").read_bytes().replace(b"\n", b"\r\n"))
    save_scan(load_scan(case / "m1.txt"), case / "m1.pcd")
    save_ideal(load_ideal(case / "i1.txt"), case / "i1.parquet")
    edit(case / "case.toml", "m1.txt", "m1.pcd")
    edit(case / "case.toml", "i1.txt", "i1.parquet")
    assert len(load_case(case).frames) == 6


def test_sub_beams_objects_and_times(case):
    ideal = load_ideal(case / "i2.txt")
    twice = {
        name: np.concatenate([getattr(ideal, name)] * 2)
        for name in ("layer", "point", "distance_m", "material_id", "incidence_deg")
    }
    more = type(ideal)(**twice, object_id=np.ones(1200, np.int32), time_s=np.zeros(1200))
    save_ideal(more, case / "i2.txt")
    assert len(load_case(case).frames[2].ideal) == 1200


def mirrored(case, factor=1.0):
    """All measured files of the case with Y negated, times a factor."""
    for k in range(6):
        file = case / f"m{k}.txt"
        lines = file.read_text().splitlines()
        names = lines[0].lstrip("/").split()
        signs = {"X": factor, "Y": -factor, "Z": factor}
        rows = [
            " ".join(
                f"{signs[name] * float(cell):.5f}" if name in signs else cell
                for name, cell in zip(names, line.split(), strict=True)
            )
            for line in lines[2:]
        ]
        file.write_text("\n".join([*lines[:2], *rows]) + "\n")


def test_mirrored_files_are_refused_with_the_key_that_declares_it(case):
    mirrored(case)
    line = refusal(case)
    assert "m0.txt: Y is mirrored: 100.0 % fit with Y negated" in line
    assert '(in a case, the frame\'s mirror = "y")' in line
    edit(case / "case.toml", "time", 'mirror = "y"\ntime', count=6)
    loaded = load_case(case)
    assert len(loaded.frames) == 6
    assert loaded.geometry.verdict == "ok"
    assert loaded.geometry.judged > 200


def test_a_unit_and_a_pose_of_a_frame(case):
    mirrored(case, 1000.0)
    edit(case / "case.toml", "time", 'unit = "mm"\nmirror = "y"\npose = {x_m = 0.0, yaw_deg = 0.0}\ntime', count=6)
    assert load_case(case).geometry.verdict == "ok"
    edit(case / "case.toml", 'unit = "mm"', 'unit = "furlong"')
    assert "unit" in refusal(case)


def test_few_rows_a_frame_are_judged_together(case):
    loaded = load_case(case)
    assert {frame.measured.geometry.verdict for frame in loaded.frames} <= {"ok", "not checked"}
    assert loaded.geometry.judged == sum(len(frame.measured) for frame in loaded.frames)
