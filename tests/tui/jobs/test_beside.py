"""What stands beside a measured frame: as a data set or a case says, else by name; what is lacking is said."""

from lidarcheck.session.project import Entry, Project
from lidarcheck.tui.jobs.beside import beside
from lidarcheck.tui.jobs.scenes import Effects, scene_jobs

DATASET = """\
[dataset]
sensor = "HDL-32E"

[[frames]]
measured = "first.csv"
ideal = "truth.csv"
distance_m = 25.0
pose = {z_m = -1.8}

[[frames]]
measured = "second.csv"
"""
CASE = 'model = "m.toml"\n\n[[frames]]\nideal = "street.parquet"\nmeasured = "a.pcd"\ntime = 0.0\n'


def test_data_sets_and_cases_say_what_belongs_to_a_frame(tmp_path):
    root = tmp_path.resolve()
    for folder in ("set", "case", "names"):
        (root / folder).mkdir()
    (root / "set/dataset.toml").write_text(DATASET)
    (root / "case/case.toml").write_text(CASE)
    kinds = {
        "set/first.csv": "scan", "set/second.csv": "scan", "set/truth.csv": "ideal",
        "case/a.pcd": "scan", "case/street.parquet": "ideal", "case/case.toml": "case",
        "names/real_7.pcd": "scan", "names/ideal_7.pcd": "ideal", "names/other_8m.pcd": "scan",
    }  # fmt: skip
    for name in kinds:
        if not name.endswith(".toml"):
            (root / name).write_text("X Y Z AREA\n1 2 3 4\n")
    project = Project(root, tuple(Entry(root / name, kind, name) for name, kind in sorted(kinds.items())))
    found = {str(path.relative_to(root)): own for path, own in beside(project).items()}
    assert found["set/first.csv"].ideal == root / "set/truth.csv"
    assert found["set/first.csv"].placement.pose is not None
    assert found["case/a.pcd"].ideal == root / "case/street.parquet"
    assert found["names/real_7.pcd"].ideal == root / "names/ideal_7.pcd"
    assert found["set/second.csv"].ideal is None
    faults = {job.name: job.fault for job in scene_jobs(project, beside(project), lambda _scan: (None, Effects()))}
    assert "of dataset.toml names none" in faults["set/second.csv"]
    assert faults["names/other_8m.pcd"].startswith("no ideal scan is named like it: ideal_other_8m.txt")
    # A case with a fault is Explain's to tell.
    (root / "case/case.toml").write_text("frames = 7\n")
    assert root / "case/a.pcd" not in beside(project)
