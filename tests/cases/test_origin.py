"""Where a case's ideal scans come from, what these cannot show, and what each frame is for."""

import re

import pytest

from explain_kit import write_case
from lidarcheck.cases.case import load_case
from lidarcheck.cases.origin import Origin
from lidarcheck.cases.split import split_frames
from lidarcheck.effects.finding import catalogue
from lidarcheck.effects.search import search_spec
from lidarcheck.errors import LidarcheckError, UsageError

PARTS = ("fit", "fit", "fit", "select", "verify", "verify")


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    return write_case(tmp_path_factory.mktemp("good") / "case", frames=6)


def keyed(good, tmp_path, top="", parts=PARTS):
    """The case with further keys at the top, and a part for each frame; None: no part."""
    text = (good / "case.toml").read_text()
    found = iter(parts)

    def with_part(match):
        part = next(found)
        return match[0] if part is None else f'{match[0]}\npart = "{part}"'

    text = re.sub(r"time = .*", with_part, text)
    for file in good.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    (tmp_path / "case.toml").write_text(f"{top}{text}")
    return tmp_path


def refusal(place, **how):
    with pytest.raises(LidarcheckError) as caught:
        load_case(place, **how)
    return "\n".join(caught.value.lines())


def test_a_case_that_does_not_say_is_as_ever(good):
    case = load_case(good)
    assert case.origin == Origin()
    assert [frame.part for frame in case.frames] == [""] * 6
    assert not any(frame.repeated for frame in case.frames)
    assert not split_frames(case.frames).declared


def test_the_keys_are_read(good, tmp_path):
    case = load_case(keyed(good, tmp_path, 'ideals_from = "repeats"\nlaws_from = "repeats"\n'))
    assert case.origin == Origin("repeats", laws_fitted=True, repeats=3)
    assert all(frame.origin == case.origin and frame.repeated for frame in case.frames)
    split = split_frames(case.frames)
    assert split.numbers() == {"fit": (0, 1, 2), "select": (3,), "verify": (4, 5)}
    assert split.declared


def test_repeats_are_what_the_case_says_else_the_frames_but_one(good, tmp_path):
    top = 'ideals_from = "repeats"\n'
    assert load_case(keyed(good, tmp_path, top, [None] * 6)).origin.repeats == 5
    assert load_case(keyed(good, tmp_path, f"{top}repeats = 40\n")).origin.repeats == 40
    case = load_case(keyed(good, tmp_path, 'ideals_from = "map"\npose_from = "fit"\n', [None] * 6))
    assert case.origin == Origin("map", pose_fitted=True)
    assert not case.frames[0].repeated


ALONE = "means nothing without ideals_from = "
FAULTS = {
    "source": ('ideals_from = "scene"\n', PARTS, "case.toml:1: ideals_from = "),
    "pose": (
        'ideals_from = "repeats"\npose_from = "fit"\n', PARTS, f'case.toml:2: `pose_from` {ALONE}"snippet" or "map"',
    ),
    "laws": ('laws_from = "repeats"\n', PARTS, f'case.toml:1: `laws_from` {ALONE}"repeats"'),
    "number": ("repeats = 3\n", PARTS, f'case.toml:1: `repeats` {ALONE}"repeats"'),
    "few": ('ideals_from = "repeats"\nrepeats = 1\n', PARTS, "case.toml:2: repeats = 1"),
    "part": ("", ("fitted", *PARTS[1:]), "case.toml:7: frames[0].part = "),
    "some": ("", ("fit", "select", "verify", None, None, "fit"), "frame 3 has no `part`, and others have"),
    "none to verify": ("", ("fit", "fit", "fit", "select", "select", "fit"), 'no frame has part = "verify"'),
}  # fmt: skip


@pytest.mark.parametrize(("top", "parts", "says"), FAULTS.values(), ids=FAULTS)
def test_what_contradicts_itself_is_refused_with_its_line(good, tmp_path, top, parts, says):
    assert says in refusal(keyed(good, tmp_path, top, parts))


def test_a_fit_alone_needs_no_other_parts(good, tmp_path):
    place = keyed(good, tmp_path, "", ["fit"] * 6)
    assert len(load_case(place, fewest=1).frames) == 6


def test_fewer_than_three_repeats_give_laws_and_no_verdict(tmp_path):
    place = write_case(tmp_path / "two", frames=2)
    (place / "case.toml").write_text('ideals_from = "repeats"\n' + (place / "case.toml").read_text())
    said = refusal(place)
    assert "too few frames to split; measure 3 or more" in said
    assert "fewer give the laws of range, noise and loss, and no verdict" in said
    assert "\n" not in said


def test_a_part_whose_frames_are_all_left_out_cannot_be_split(good, tmp_path):
    case = load_case(keyed(good, tmp_path))
    with pytest.raises(UsageError, match="no frame to select is left"):
        split_frames([frame for frame in case.frames if frame.part != "select"])


TESTABLE = {
    "timing_jitter", "dropout", "vibration", "interference", "rain", "motion", "ambient_light", "dark_counts",
    "threshold", "signal_gain",
}  # fmt: skip


def unseen(origin):
    return {name: why for name in catalogue() if (why := origin.why_unseen(search_spec(name)))}


def test_what_repeats_cannot_show():
    found = unseen(Origin("repeats", repeats=9))
    assert catalogue().keys() - found.keys() == TESTABLE
    assert set(found.values()) == {"what is constant in time is in the ideal scan, which was made from repeats"}
    fitted = unseen(Origin("repeats", laws_fitted=True, repeats=9))
    more = fitted.keys() - found.keys()
    assert more == {"timing_jitter", "ambient_light", "dark_counts", "threshold"}
    assert all("only as a change between the frames to fit and those to verify" in fitted[name] for name in more)


def test_what_a_fitted_pose_or_plane_hides():
    assert unseen(Origin("snippet")) == unseen(Origin("map")) == unseen(Origin()) == {}
    for source in ("snippet", "map"):
        assert unseen(Origin(source, pose_fitted=True)).keys() == {"range_offset", "range_scale", "boresight"}


def test_with_few_repeats_less_is_judged():
    judged = {
        n: (Origin("repeats", repeats=n).judges_location, Origin("repeats", repeats=n).judges_rates)
        for n in (2, 3, 4, 5)
    }
    assert judged == {2: (False, False), 3: (False, True), 4: (False, True), 5: (True, True)}
    assert Origin("map").judges_location
    assert Origin().judges_rates


def test_frames_of_a_scene_at_rest_are_not_taken_for_swapped(good, tmp_path):
    """Any of them fits any ideal scan of the same scene: which fits best is chance."""
    place = keyed(good, tmp_path)
    (place / "m0.txt").rename(place / "t.txt")
    (place / "m1.txt").rename(place / "m0.txt")
    (place / "t.txt").rename(place / "m1.txt")
    assert "m0.txt fits i1.txt of frame 1 better" in refusal(place)
    text = (place / "case.toml").read_text()
    (place / "case.toml").write_text(f'ideals_from = "repeats"\n{text}')
    assert len(load_case(place).frames) == 6
