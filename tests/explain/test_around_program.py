"""`explain` around the compiled example, a sensor model that is not ours and knows nothing of what hides around it."""

import shutil

import pytest

from hidden.around.cases import write_case
from hidden.foreign.orders import CaseOrder
from lidarcheck.cases.case import load_case
from lidarcheck.explain.workflow import explain
from own_models_kit import COMPILED

pytestmark = [
    pytest.mark.usefixtures("trusting"),
    pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler cc on this machine"),
]


@pytest.mark.long
@pytest.mark.parametrize("name", ["walk_error", "retro_ghost"])
def test_what_hides_around_it_is_named(name, tmp_path):
    write_case(CaseOrder(1, "single", 1001, (name,), "medium", COMPILED, "street"), tmp_path / "case")
    found = explain(load_case(tmp_path / "case"), seed=0)
    assert found.verdict == "explained"
    assert [finding.name for finding in found.findings] == [name]
    inside = "it acts inside the program, and no number of [external.parameters] stands for it"
    assert found.not_testable["crosstalk"] == inside
    assert found.not_testable.get("threshold") != inside, "a number of the program stands for it"
    assert found.not_testable["fog"] == "[external] names no scatter_material for what the air sends back"
