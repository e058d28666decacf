"""A model that is a Python function: what it is given, what it may return, and how its faults are said."""

import dataclasses
import os
import textwrap
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from external_kit import IDEAL, gone, refusal
from lidarcheck.model.external import Request, run_requests
from lidarcheck.model.spec import External

pytestmark = pytest.mark.usefixtures("trusting")

ECHOES = """
hit = ideal["Distance"] > 0
columns = {name: ideal[name][hit] for name in ("Layer", "Point")}
columns |= {"RANGE": ideal["Distance"][hit], "EchoNumber": np.ones(hit.sum(), int)}
columns |= {name: np.ones(hit.sum()) for name in ("WIDTH", "AREA", "PEAK")}
"""


@pytest.fixture
def module(tmp_path: Path) -> Callable[..., External]:
    """A function whose body is `ECHOES` and then some text."""

    def made(body: str, head: str = "def simulate(ideal, seed):", function: str = "simulate", **how: float) -> External:
        text = f"import os, sys, time\nimport numpy as np\n\n{head}\n"
        package = tmp_path / "models" / "own_model"
        package.mkdir(parents=True, exist_ok=True)
        (package / "__init__.py").touch()
        (package / "echoes.py").write_text(text + textwrap.indent(ECHOES + body, "    "))
        return External((), tmp_path / "models", module=f"own_model.echoes:{function}", **how)

    return made


def test_a_function_simulates(module, capfd):
    external = module("print('not data'); os.system('echo nor this'); columns['AREA'] *= seed\nreturn columns")
    scans = run_requests(external, [Request(IDEAL, seed) for seed in (3, 4)], jobs=1)
    assert [scan.area.tolist() for scan in scans] == [[3.0, 3.0], [4.0, 4.0]]
    assert scans[0].range_m == pytest.approx([20.0, 33.5])
    assert capfd.readouterr() == ("", "")


def test_echoes_of_one_beam_with_one_number_are_numbered_by_their_range(module):
    body = "columns['Layer'][:], columns['Point'][:], columns['EchoNumber'] = 10, 7, np.ones(2)\nreturn columns"
    [scan] = run_requests(module(body), [Request(IDEAL)])
    assert dict(zip(scan.echo_number.tolist(), scan.range_m.tolist(), strict=True)) == pytest.approx({1: 20.0, 2: 33.5})


def test_it_is_given_the_columns_that_are_asked_for_as_plain_arrays(module):
    ideal = dataclasses.replace(IDEAL, share=np.array([0.5, 0.25, 1.0]), extra={"Background": np.full(3, 2.5)})
    body = "raise SystemExit({name: (type(c).__name__, c.dtype.str, c.tolist()) for name, c in ideal.items()})"
    line = refusal(module(body), Request(ideal, columns=("Share",)))
    assert "('ndarray', '<i4', [10, 11, 12])" in line
    assert "'Share': ('ndarray', '<f8', [0.5, 0.25, 1.0])" in line
    assert "Background" not in line


def test_seed_frame_and_own_parameters_where_it_takes_them(module, tmp_path):
    body = "columns['AREA'] *= seed + 10 * frame + gain\nreturn columns"
    external = module(body, "def simulate(ideal, *, gain, seed=0, frame=0):")
    [scan] = run_requests(external, [Request(IDEAL, 2, 3, {"gain": 0.5})])
    assert scan.area.tolist() == [32.5, 32.5]
    assert "cannot be called with the ideal scan, seed, frame: missing a required argument: 'gain'" in refusal(external)
    line = refusal(external, Request(IDEAL, parameters={"gain": 1.0, "loss": 1.0}))
    assert "cannot be called with the ideal scan, seed, frame, gain, loss: got an unexpected keyword" in line
    settings = tmp_path / "s.ini"
    settings.write_text("12")
    body = "columns['AREA'] *= float(open(ini).read())\nreturn columns"
    external = dataclasses.replace(module(body, "def simulate(ideal, ini):"), ini=settings)
    [scan] = run_requests(external, [Request(IDEAL, 2, 3)])
    assert scan.area.tolist() == [12.0, 12.0]


def test_one_process_loads_it_once(module):
    external = module("columns['AREA'] *= os.getpid()\nreturn columns")
    requests = [Request(IDEAL, seed) for seed in range(4)]
    (first, *_), *others = [scan.area.tolist() for scan in run_requests(external, requests, jobs=1)]
    assert all(area == [first, first] for area in others)
    assert first != os.getpid()


MODEL = "the external model own_model.echoes:simulate"
BAD = [
    ("c['Gain']", f"own_model/echoes.py:5: {MODEL} raised KeyError: 'Gain'; "),
    ("sys.exit(3)", f"own_model/echoes.py:6: {MODEL} raised SystemExit: 3; "),
    ("np.linalg.inv(np.zeros((2, 2)))", f"own_model/echoes.py:7: {MODEL} raised LinAlgError: Singular matrix"),
    ("[1]", f"echoes.py:17: {MODEL} returned a list, not a dict of columns"),
    ("c | {'AREA': c['AREA'][:1]}", "returned 1 rows of AREA and 2 of Layer; columns are equally long"),
    ("c | {'AREA': ['a', 'b']}", "returned a column AREA of <U1, not of numbers"),
    ("c | {'AREA': c['AREA'][:, None]}", "returned a column AREA of shape (2, 1); a column has a number a row"),
    ("{'RANGE': c['RANGE']}", "returned a malformed scan: no column X, Y, Z"),
    ("c | {'Layer': c['Layer'] + 9999}", "returned a malformed scan: "),
    ("os.write(1, b'bye') and os._exit(3)", 'ended with exit code 3 before it had answered (it said: "bye")'),
    ("os.kill(os.getpid(), 11)", "was killed by SIGSEGV before it had answered"),
]


def test_what_a_function_must_not_do(module):
    cases = "\n".join(f"    lambda c: {body}," for body, _ in BAD)
    external = module("return CASES[seed](columns)", f"CASES = [\n{cases}\n]\ndef simulate(ideal, seed):")
    for seed, (_, said) in enumerate(BAD):
        line = refusal(external, Request(IDEAL, seed))
        assert said.removesuffix("; ") in line
        assert line.isprintable()
        assert line.startswith("error: ")


def test_one_that_hangs_is_killed_with_all_that_it_started(module, tmp_path):
    child = "import subprocess\nchild = subprocess.Popen(['sleep', '60']).pid\n"
    body = child + "open('../pids', 'w').write(f'{os.getpid()} {child}')\ntime.sleep(60)"
    assert "own_model.echoes:simulate took longer than 5 s; raise timeout_s" in refusal(module(body, timeout_s=5.0))
    assert all(gone(int(pid)) for pid in (tmp_path / "pids").read_text().split())


LOADING = [
    ("own_model.echo:simulate", "cannot be found: there is no module own_model.echo; put it beside the model file"),
    ("own_modell.echoes:simulate", "own_modell.echoes:simulate cannot be found: there is no module own_modell; put it"),
    ("own_model.echoes:simulat", "has no function simulat; did you mean simulate?"),
    ("own_model.echoes:np", "names np, which is no function"),
    ("broken:simulate", "broken.py:2: the external model broken:simulate cannot be loaded: SyntaxError"),
    (
        "sibling:simulate",
        "cannot be loaded: ModuleNotFoundError: No module named 'beside'; install it, or ",
    ),
    ("failing:simulate", "failing.py:3: the external model failing:simulate cannot be loaded: ZeroDivisionError"),
]


@pytest.mark.parametrize(("name", "said"), LOADING)
def test_what_cannot_be_loaded(name, said, module, tmp_path):
    external = dataclasses.replace(module("return columns"), module=name)
    for file, text in {
        "broken": "x = 1\ndef (",
        "sibling": "import beside\n",
        "beside": "",
        "failing": "\n\n1 / 0\n",
    }.items():
        (tmp_path / "models" / f"{file}.py").write_text(text)
    assert said in refusal(external)


def test_after_an_exception_the_process_goes_on(module):
    external = module("assert seed != 1, 'one'\ncolumns['AREA'] *= os.getpid()\nreturn columns")
    before = run_requests(external, [Request(IDEAL, 0)])[0].area[0]
    assert "raised AssertionError: one" in refusal(external, Request(IDEAL, 1))
    assert run_requests(external, [Request(IDEAL, 2)])[0].area[0] == before


def test_a_changed_function_is_loaded_again(module, tmp_path):
    """Though the file is as long as before and as old."""
    for factor in (7, 8):
        external = module(f"columns['AREA'] *= {factor}\nreturn columns")
        os.utime(tmp_path / "models/own_model/echoes.py", (1e9, 1e9))
        assert run_requests(external, [Request(IDEAL)])[0].area[0] == factor


def test_a_module_of_one_file_and_of_another_sensor_column(module, tmp_path):
    module("return columns")
    (tmp_path / "models" / "alone.py").write_bytes((tmp_path / "models/own_model/echoes.py").read_bytes())
    [scan] = run_requests(External((), tmp_path / "models", module="alone:simulate"), [Request(IDEAL)])
    assert len(scan) == 2


def test_what_is_said_of_its_echoes_is_said_once(module, caplog):
    external = module("del columns['AREA']\nreturn columns", "def without_area(ideal):", "without_area")
    run_requests(external, [Request(IDEAL, seed) for seed in range(3)], jobs=1)
    [record] = [record for record in caplog.records if "filled in" in record.message]
    assert record.getMessage().startswith("the external model own_model.echoes:without_area: missing columns were ")
