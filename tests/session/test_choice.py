"""One choice for all screens."""

from lidarcheck.session.choice import Choice
from lidarcheck.session.model_choice import chosen_model
from lidarcheck.session.project import Entry, Project

MODEL = 'variant = "{}"\n[materials.1]\nname = "panel"\nreflectance = 0.5\n'


def test_a_choice_is_kept_in_the_state_and_told_once(tmp_path):
    kept, told = {}, []
    choice = Choice(kept)
    choice.on_change = told.append
    scan = tmp_path / "signs/69m.txt"
    project = Project(tmp_path, (Entry(scan, "scan", "signs/69m.txt"),))
    assert choice.measured(project) is None
    assert choice.choose_measured(scan, project)
    assert not choice.choose_measured(scan, project)
    assert not choice.choose_measured(tmp_path / "other.txt", project)
    choice.next_feature(("AREA", "PEAK"))
    assert choice.feature(("AREA", "PEAK")) == "PEAK"
    choice.next_feature(("PEAK", "AREA"))
    assert choice.target is None
    choice.choose("target", "7")
    assert told == ["measurement", "feature", "feature", "target"]
    again = Choice(kept)
    assert (again.measured(project), again.feature(("PEAK", "AREA")), again.target) == (scan, "AREA", 7)
    assert again.feature(("INTENSITY", "range")) == "INTENSITY"  # of another sensor
    kept |= {"feature": "nothing", "target": "-"}  # somebody wrote in the state's file
    assert (again.feature(("PEAK", "AREA")), again.target) == ("PEAK", None)


def test_a_chosen_model_is_taken_where_it_can_be_meant(tmp_path):
    entries = []
    for name in ("SMART", "SLIM"):
        (tmp_path / f"{name}.toml").write_text(MODEL.format(name))
        entries.append(Entry(tmp_path / f"{name}.toml", "model", f"{name}.toml"))
    project = Project(tmp_path, tuple(entries))
    assert chosen_model(project, "SLIM.toml", tmp_path).name == "SLIM.toml"
    assert chosen_model(project, "SLIM.toml", tmp_path, "SMART").name == "SMART.toml"
