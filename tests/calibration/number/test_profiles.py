"""The misfit of a profile that stands in a table, of which nobody knows single echoes."""

import csv

import numpy as np
import pytest

from lidarcheck.calibration.blooming.cells import profile_of
from lidarcheck.calibration.blooming.workflow import BloomingMeasurement, gather, model_side_of
from lidarcheck.calibration.number.entry import expected, sample
from lidarcheck.calibration.number.number import judged
from lidarcheck.calibration.number.request import Request
from lidarcheck.errors import InputError
from lidarcheck.model import load_model
from lidarcheck.reading import reading
from number_kit import asked, changed, project


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A sign, its profile as means over the offset, and the same without AREA at every other offset."""
    place = project(tmp_path_factory.mktemp("sign"))
    [measured], [ideal] = asked(place).measured, asked(place).ideal
    bench = model_side_of(load_model(place / "model.toml"), "vertical")
    [cells] = gather([BloomingMeasurement(measured, None, ideal)], bench)
    profile = profile_of(cells)
    rows = np.column_stack([profile.offset, profile.range_m, profile.value]).tolist()
    for name, gaps in (("profile.csv", 0), ("gaps.csv", 2)):
        with (place / name).open("w", newline="") as stream:
            out = csv.writer(stream)
            out.writerow(["offset_spad_rows", "range_m", "PEAK", "AREA", "WIDTH_ns"])
            for i, row in enumerate(rows):
                cell = ["" if np.isnan(v) or (gaps and i % gaps and j == 3) else v for j, v in enumerate(row)]
                out.writerow(cell)
    return place


@pytest.mark.parametrize("name", ["profile.csv", "gaps.csv"])
def test_a_profile_tells_a_wrong_row_without_an_ideal_scan(folder, name):
    request = Request("misfit", folder / "model.toml", (folder / name,))
    first = sample(request)
    assert first.value < 2.0
    assert first.parts["detected"] == 0.0
    assert expected(request) is None
    with reading({str((folder / "table.ini").resolve()): changed(7, 2.0).encode()}):
        step = judged(first, sample(request))
    assert step.word == "worse"
    assert judged(first, sample(Request("misfit", folder / "model.toml", (folder / name,), seed=4))).word[:4] == "same"


def test_the_other_axis_is_refused(folder):
    with pytest.raises(InputError, match="is a vertical profile, and the horizontal table is edited"):
        sample(Request("misfit", folder / "model.toml", (folder / "profile.csv",), axis="horizontal"))
