"""What several test files share."""

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SHARED = ROOT.parent / "shared"


def shared_path(name: str) -> Path:
    """A real capture outside the repository; skips the test, saying so, when it is not on this machine."""
    path = SHARED / name
    if not path.exists():
        pytest.skip(f"real input {name} is not on this machine")
    return path
