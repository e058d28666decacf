"""The sensor models of `examples/` that are not ours: each holds its golden, and a change in it is noticed."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from lidarcheck.cli import main
from lidarcheck.errors import ExternalModelError
from lidarcheck.formats import load_ideal
from lidarcheck.model import load_model
from lidarcheck.model.external import Request, run_requests
from own_models_kit import COMPILED, FUNCTION, ROOT, own_model

pytestmark = pytest.mark.usefixtures("trusting")

CHANGES = {
    COMPILED: ("waveform.ini", "energy = 400000", "energy = 370000"),
    FUNCTION: ("own_lidar/model.py", "ENERGY = 150_000.0", "ENERGY = 139_000.0"),
}
IDEAL = """\
//Layer Point Distance MaterialID IncidenceAngle Share Background
5
16 600 20 3 0 1.0 1.0
16 601 20 3 0 0.25 1.0
16 602 10 3 0 0.5 1.0
16 602 30 3 0 0.5 1.0
16 603 0 1 0 1.0 1.0
"""


@pytest.fixture(params=CHANGES)
def name(request):
    return request.param


def test_it_holds_its_golden_and_a_change_in_it_is_noticed(name, tmp_path, monkeypatch, capsys):
    folder = own_model(name, tmp_path)
    monkeypatch.chdir(folder)
    assert main(["check", "-q", "--jobs", "2"]) == 0
    assert "check holds: 5 KPIs in 1 scenario" in capsys.readouterr().out
    file, old, new = CHANGES[name]
    text = (folder / file).read_text(encoding="utf-8")
    assert old in text
    (folder / file).write_text(text.replace(old, new), encoding="utf-8")
    assert main(["check", "-q", "--jobs", "2"]) == 1
    assert "FAILED wall feature_mean.INTENSITY.object_1" in capsys.readouterr().out


def test_it_reads_shares_and_background_and_repeats(name, tmp_path):
    folder = own_model(name, tmp_path)
    model = load_model(folder / "model.toml")
    (tmp_path / "ideal.txt").write_text(IDEAL)
    ideal = load_ideal(tmp_path / "ideal.txt", model.sensor)

    def run(seed=0, **changed):
        table = dataclasses.replace(ideal, **changed)
        request = Request(table, seed, columns=("Share", "Background"))
        return run_requests(model.external, [request], model.sensor)[0]

    first = run()
    assert first.point.tolist() == [600, 601, 602, 602]
    strength = first.feature("INTENSITY")
    assert 3.0 < strength[0] / strength[1] < 5.5
    assert first.range_m == pytest.approx([20.0, 20.0, 10.0, 30.0], abs=0.25)
    assert np.array_equal(run().feature("INTENSITY"), strength)
    assert not np.array_equal(run(seed=1).feature("INTENSITY"), strength)
    noisy = run(extra={"Background": np.full(len(ideal), 400.0)})
    assert np.abs(noisy.feature("INTENSITY")[:4] - strength).max() > 5.0


def test_the_server_gives_the_echoes_of_the_program(tmp_path):
    folder = own_model(COMPILED, tmp_path)
    (tmp_path / "ideal.txt").write_text(IDEAL)
    scans = []
    for file in ("model.toml", "server.toml"):
        model = load_model(folder / file)
        ideal = load_ideal(tmp_path / "ideal.txt", model.sensor)
        requests = [Request(ideal, seed, frame, columns=("Share",)) for seed in (1, 2) for frame in (0, 1)]
        scans.append(run_requests(model.external, requests, model.sensor))
    for alone, served in zip(*scans, strict=True):
        assert np.array_equal(alone.x_m, served.x_m)
        assert np.array_equal(alone.feature("INTENSITY"), served.feature("INTENSITY"))
    assert len({tuple(scan.feature("INTENSITY")) for scan in scans[0]}) == 4


def test_what_the_program_cannot_do_is_one_line_and_the_server_goes_on(tmp_path):
    folder = own_model(COMPILED, tmp_path)
    model = load_model(folder / "server.toml")
    (tmp_path / "ideal.txt").write_text(IDEAL)
    ideal = load_ideal(tmp_path / "ideal.txt", model.sensor)
    unknown = dataclasses.replace(ideal, material_id=np.full(len(ideal), 50, dtype=np.int32))
    with pytest.raises(ExternalModelError, match=r"refused a run: a material without reflectance in .*waveform.ini"):
        run_requests(model.external, [Request(unknown)], model.sensor)
    assert len(run_requests(model.external, [Request(ideal)], model.sensor)[0]) > 2


def test_no_compiled_program_lies_in_the_examples():
    texts = [path for path in (ROOT / "examples").rglob("*") if path.is_file() and path.name != "waveform"]
    assert not [path for path in texts if b"\0" in path.read_bytes() and "__pycache__" not in path.parts]
    assert "/waveform" in (ROOT / "examples" / COMPILED / ".gitignore").read_text().split()
    assert Path(ROOT / "examples" / COMPILED / "Makefile").is_file()
