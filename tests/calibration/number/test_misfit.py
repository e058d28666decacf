"""The misfit of a table: what it says of an edit, of none, and of one that no beam sees; on several sensors."""

from dataclasses import replace

import numpy as np
import pytest

from lidarcheck.calibration.number import entry, light
from lidarcheck.calibration.number.entry import expected, sample
from lidarcheck.calibration.number.memo import Memo
from lidarcheck.calibration.number.number import UNSEEN, judged
from lidarcheck.errors import InputError
from lidarcheck.model import incremental
from lidarcheck.reading import reading
from number_kit import asked, changed, project, table


@pytest.fixture(scope="module")
def sign(tmp_path_factory):
    return project(tmp_path_factory.mktemp("sign"))


def edited(folder, text, compute=sample, **more):
    with reading({str((folder / "table.ini").resolve()): text.encode()}):
        return compute(asked(folder, **more))


def test_a_wrong_row_is_worse_its_undo_the_same_number_and_an_unseen_row_is_not_judged(sign):
    first = sample(asked(sign))
    assert first.kind == "misfit"
    assert first.value < 1.3 * first.floor < 0.5
    assert set(first.parts) == {"detected", "AREA", "PEAK", "WIDTH"}
    assert first.sample.endswith(" beams x 8")
    wrong = edited(sign, changed(7, 1.6))
    step = judged(first, wrong)
    assert step.word == "worse"
    assert step.low > 0.0
    assert judged(wrong, first).word == "better"
    # What it is made of: beyond chance where the row is, darker than what is simulated, and hardly anywhere at first.
    assert set(wrong.residual.off) == set(wrong.parts)
    far = wrong.residual.off["AREA"] / wrong.residual.chance["AREA"]
    x = float(table().splitlines()[0].split("=")[1].split(",")[7])
    assert far[np.abs(wrong.residual.offset - x) < 0.6].min() < -4.0
    right = np.abs(first.residual.off["AREA"] / first.residual.chance["AREA"])
    assert np.nanmean(right < 2.0) > 0.8
    again = edited(sign, table())
    assert again.value == first.value
    assert again.simulated == first.simulated
    assert np.array_equal(again.left_out, first.left_out)
    unseen = edited(sign, changed(0, 3.0))
    assert unseen.value == first.value
    step = judged(first, unseen)
    assert (step.word, step.difference) == (UNSEEN, 0.0)


def test_an_expectation_comes_near_to_what_is_then_simulated(sign):
    for row, factor in ((7, 1.6), (3, 0.5), (5, 1.0)):
        sample(asked(sign))
        hoped = edited(sign, changed(row, factor), expected)
        found = edited(sign, changed(row, factor))
        assert not hoped.exact
        assert hoped.value == pytest.approx(found.value, rel=0.05, abs=0.01)


def test_a_new_seed_is_no_edit_and_more_seeds_are_another_sample(sign):
    wrong = edited(sign, changed(7, 1.6))
    other = edited(sign, changed(7, 1.6), seed=5)
    assert judged(wrong, other).word.startswith("same")
    assert edited(sign, changed(7, 1.6), seeds=16).sample.endswith("x 16")


def test_a_progress_that_raises_stops_between_seeds_and_nothing_is_kept(sign):
    told = []

    def stop(done, of, now):
        told.append((done, of, now))
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sample(asked(sign, seed=77), stop)
    assert told == [(0, 8, "seeds"), (1, 8, "seeds"), (2, 8, "seeds")]
    assert sample(asked(sign, seed=77)).value > 0.0


def test_targets_at_two_distances_are_looked_at_together_or_one_by_one(tmp_path):
    both = project(tmp_path, at_m=(100.0, 60.0))
    together = sample(asked(both))
    near, far = (sample(asked(both, distance_m=at)) for at in (60.0, 100.0))
    beams = [int(one.sample.split(" beams")[0].replace(" ", "")) for one in (together, near, far)]
    assert beams[0] == beams[1] + beams[2]
    with pytest.raises(InputError, match=r"within 3 m of 80 m; there are some at 60.0, 100.0 m"):
        sample(asked(both, distance_m=80.0))


def test_a_table_along_layers_counts_lines_of_layers(tmp_path):
    side = project(tmp_path, axis="horizontal", layers=(245, 275), points=(400, 560))
    first = sample(asked(side, axis="horizontal"))
    assert first.blocks == "8 blocks: lines"
    assert first.value < 1.5 * first.floor
    with reading({str((side / "table.ini").resolve()): table([1.8e-3 if x == 1e-3 else x for x in (
        5e-5, 5e-5, 2e-4, 4e-4, 1e-3, 1.0, 1e-3, 4e-4, 2e-4, 5e-5)], "horizontal").encode()}):  # fmt: skip
        assert judged(first, sample(asked(side, axis="horizontal"))).word == "worse"


def test_where_the_target_has_few_lines_each_beam_is_a_block(tmp_path):
    narrow = project(tmp_path, own=((255, 263), (472, 474)))
    first = sample(asked(narrow))
    assert first.blocks == "beams, as the target has 2 lines"
    assert judged(first, edited(narrow, changed(7, 2.5))).word == "worse"


def test_another_sensor_is_compared_by_its_own_features_or_it_is_said_why_not(tmp_path):
    other = project(tmp_path, variant="CARLA", layers=(0, 32), points=(60, 100), own=((14, 18), (74, 84)), at_m=(30.0,))
    first = sample(asked(other))
    assert list(first.parts) == ["detected", "INTENSITY"]
    assert first.value < 1.5 * first.floor + 0.1
    assert expected(asked(other)) is None
    text = (other / "model.toml").read_text().replace("CARLA", "XT32").split("[[effects]]")[0]
    (other / "alone.toml").write_text(text)
    with pytest.raises(InputError, match="does not bloom: each of its beams has a receiver of its own"):
        sample(replace(asked(other), model=other / "alone.toml"))


def test_without_an_ideal_scan_the_target_is_found_where_it_saturates(sign):
    alone = replace(asked(sign), ideal=(), distance_m=100.0)
    first = sample(alone)
    assert first.value < 1.5 * first.floor
    with reading({str((sign / "table.ini").resolve()): changed(7, 1.6).encode()}):
        assert judged(first, sample(alone)).word == "worse"
    with pytest.raises(InputError, match="nothing saturates within 3 m of 60 m"):
        sample(replace(alone, distance_m=60.0))


def test_without_an_ideal_scan_or_a_target_it_says_why(sign):
    with pytest.raises(InputError, match="has no ideal scan"):
        sample(replace(asked(sign, "gap"), ideal=()))
    (sign / "dull.toml").write_text(
        (sign / "model.toml").read_text().replace('kind = "retro"\nretro_gain = 1000.0', "")
    )
    with pytest.raises(InputError, match="no beam of its ideal scan has S of"):
        sample(replace(asked(sign), model=sign / "dull.toml"))


@pytest.mark.parametrize("air", ["", '\n[[effects]]\nname = "fog"\nmor_m = 400.0\n'], ids=["clear", "fog"])
def test_an_edit_simulates_the_beams_that_it_lights_otherwise_and_gives_the_same_number(tmp_path, monkeypatch, air):
    folder = project(tmp_path)
    (folder / "model.toml").write_text((folder / "model.toml").read_text() + air)
    simulated, echoes_of = [], incremental.echoes_of

    def counted(part, *args, **how):
        simulated.append(len(part))
        return echoes_of(part, *args, **how)

    monkeypatch.setattr(incremental, "echoes_of", counted)
    first = sample(asked(folder))
    before = sum(simulated)
    found = edited(folder, changed(7, 1.3))
    after = sum(simulated) - before
    assert judged(first, found).word != UNSEEN
    assert 0 < after < 0.6 * before
    monkeypatch.setattr(entry, "_NUMBERS", Memo(400))
    monkeypatch.setattr(light, "_LAST", Memo(4))
    again = edited(folder, changed(7, 1.3))
    assert sum(simulated) - before - after == before
    assert (again.value, again.parts, again.simulated) == (found.value, found.parts, found.simulated)
    assert np.array_equal(again.left_out, found.left_out)
