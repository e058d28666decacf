"""The public interface: what `import lidarcheck` offers, and that nothing is loaded before it is asked for."""

import ast
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

import lidarcheck

STUB = Path(lidarcheck.__file__).with_suffix(".pyi")
TYPES = ("Calibration", "Case", "Comparison", "Explanation", "IdealScan", "LidarcheckError", "Model", "Scan")


def in_a_fresh_interpreter(program: str) -> str:
    return subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True).stdout


def test_an_import_loads_nothing_but_the_package_itself():
    loaded = "import sys, lidarcheck; print([name for name in sys.modules if name.startswith('lidarcheck.')])"
    assert in_a_fresh_interpreter(loaded).strip() == "[]"
    heavy = "import sys, lidarcheck; print({'numpy', 'numba', 'scipy', 'pydantic'} & set(sys.modules))"
    assert in_a_fresh_interpreter(heavy).strip() == "set()"


@pytest.mark.parametrize("name", lidarcheck.__all__)
def test_every_public_name_is_there_and_explains_itself(name):
    found = getattr(lidarcheck, name)
    assert name in dir(lidarcheck)
    if name != "__version__":
        assert inspect.getdoc(found)
        assert inspect.isclass(found) if name in TYPES else callable(found)


def test_type_checkers_are_told_of_the_same_names():
    nodes = [node for node in ast.parse(STUB.read_text(encoding="utf-8")).body if isinstance(node, ast.ImportFrom)]
    imported = {(alias.asname, node.module) for node in nodes for alias in node.names}
    assert {name for name, _ in imported} | {"__version__"} == set(lidarcheck.__all__)
    elsewhere = {name: module for name, module in imported if lidarcheck._HOME.get(name, module) != module}
    assert elsewhere == {}


def test_what_is_not_public_is_not_there():
    with pytest.raises(AttributeError, match="no attribute 'load_scan'"):
        getattr(lidarcheck, "load_" + "scan")


@pytest.mark.parametrize(
    "program",
    [
        "from lidarcheck import explain",
        "import lidarcheck.explain.workflow; from lidarcheck import explain",
        "from lidarcheck import explain; import lidarcheck.explain.workflow as workflow; workflow.explain",
    ],
)
def test_explain_is_a_function_whatever_was_imported_before(program):
    assert "True" in in_a_fresh_interpreter(f"{program}; print(callable(explain))")


def test_explain_hands_a_case_and_its_options_on(monkeypatch):
    monkeypatch.setattr("lidarcheck.explain.workflow.explain", lambda case, **options: (case, options))
    assert lidarcheck.explain("case", seed=3, jobs=2) == ("case", {"seed": 3, "jobs": 2})
