"""A fixed 50 wrongs and 50 rights of `ci/fuzz_geometry`: no wrong is silent, no right is refused."""

from geometry_fuzz import trials
from places import ROOT

EXAMPLES = ("lab_panels_SLIM", "weak_targets_SMART", "effect_range_offset_SLIM", "scene_wet_road_SMART")
"""Scenarios that are simulated in about a second each, near and far, and one that the sensor is driven through."""
WRONGS, RIGHTS, SEED = 50, 50, 1


def test_no_wrong_is_silent_and_no_right_is_refused() -> None:
    found = list(trials([ROOT / f"scenarios/{name}.toml" for name in EXAMPLES], WRONGS, RIGHTS, SEED))
    wrongs, rights = ([trial for trial in found if (trial.kind == "right") == right] for right in (False, True))
    assert [trial for trial in wrongs if trial.outcome == "passed"] == []
    assert [trial for trial in rights if trial.outcome not in ("passed", "not checked")] == []
    assert sum(trial.outcome == "passed" for trial in rights) >= 0.95 * len(rights)
    assert sum(trial.outcome == "refused" for trial in wrongs) >= 0.6 * len(wrongs)
