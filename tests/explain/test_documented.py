"""The case to try of docs/explain.md, typed in by a shell as it stands there."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.long
def test_the_case_to_try_is_answered_as_the_documentation_says(tmp_path: Path) -> None:
    text = (ROOT / "docs" / "explain.md").read_text()
    found = re.search(r"\*\*A case to try\*\*.*?```sh\n(.*?)```", text, re.DOTALL)
    assert found is not None
    (tmp_path / "scenarios").symlink_to(ROOT / "scenarios")
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    ended = subprocess.run(
        ["bash", "-euc", found[1]],
        cwd=tmp_path,
        env={**os.environ, "PATH": path},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr
    assert "one effect is missing from the model: walk_error" in ended.stdout
    assert 'name = "walk_error"' in (tmp_path / "found" / "model.toml").read_text()
