"""Who a worker is: the versions and the arithmetic that decide whether it finds the same numbers to the last bit."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import importlib.metadata
import math
import platform
import socket
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import lidarcheck

__all__ = ["Identity", "arithmetic", "identity", "limit_blas", "one_blas_thread", "source_of_results", "versions"]

_INTERFACES = ("cli", "figures", "session", "tui")


@dataclass(frozen=True)
class Identity:
    """A process that works: its host, and by name what its results depend on."""

    host: str
    found: Mapping[str, str]

    def differences(self, other: Identity) -> str:
        """What of this process is otherwise than in the other, in words; empty if nothing is."""
        words = [
            f"{_called(name)} {value} (here {other.found.get(name, 'none')})"
            for name, value in self.found.items()
            if value != other.found.get(name)
        ]
        return ", ".join(words)


def _called(name: str) -> str:
    return {"source": "lidarcheck's source", "arithmetic": "arithmetic"}.get(name, name)


def versions() -> dict[str, str]:
    """The versions that results depend on, by name."""
    return {
        "python": platform.python_version(),
        "numpy": importlib.metadata.version("numpy"),
        "numba": importlib.metadata.version("numba"),
        "lidarcheck": lidarcheck.__version__,
    }


@functools.cache
def identity() -> Identity:
    """Of this process."""
    found = {"lidarcheck": lidarcheck.__version__, **versions(), "scipy": importlib.metadata.version("scipy")}
    return Identity(socket.gethostname(), {**found, "source": source_of_results()[:12], "arithmetic": arithmetic()})


@functools.cache
def source_of_results() -> str:
    """SHA-256 over names and contents of the package's files, without those that only show results."""
    root = Path(lidarcheck.__file__).resolve().parent
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        if path.relative_to(root).parts[0] not in _INTERFACES:
            digest.update(path.relative_to(root).as_posix().encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()


def arithmetic() -> str:
    """A hash of what this process makes of a fixed set of numbers.

    Processors with other vector instructions, and other system libraries, round some functions otherwise, and so do
    matrix products: two processes with the same hash may be expected to find the same bits.
    """
    import numpy as np

    digest = hashlib.sha256()
    x = np.linspace(-3.0, 3.0, 1021)
    above = np.abs(x) + 1e-3
    for function in (np.exp, np.expm1, np.sin, np.cos, np.tan, np.tanh, np.arctan, np.arcsinh, np.cbrt):
        digest.update(function(x).tobytes())
    for logarithm in (np.log, np.log10, np.log2, np.log1p, np.sqrt):
        digest.update(logarithm(above).tobytes())
    digest.update(np.array([above**x, np.arctan2(x, above), np.hypot(x, above), np.cumsum(x)]).tobytes())
    of_system = (math.exp, math.log, math.log1p, math.sin, math.cos, math.atan, math.lgamma, math.erf)
    digest.update(np.array([function(value) for function in of_system for value in above.tolist()]).tobytes())
    with one_blas_thread():
        for shape in ((40, 7), (700, 130)):
            tall = np.sin(np.arange(float(shape[0] * shape[1]))).reshape(shape)
            square = tall.T @ tall
            products = (square, tall @ tall[0], np.linalg.inv(square + np.eye(shape[1])), np.linalg.eigvalsh(square))
            digest.update(b"".join(found.tobytes() for found in products))
    return digest.hexdigest()[:12]


@contextlib.contextmanager
def one_blas_thread() -> Iterator[None]:
    """Products of matrices on one core while the block runs: how many take part decides the order of the sums."""
    import scipy.linalg  # noqa: F401 - brings a library of its own, which must be there to be limited
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1, user_api="blas"):
        yield


def limit_blas() -> None:
    """The same for the rest of this process, a worker, for the libraries that are loaded now."""
    from threadpoolctl import threadpool_limits

    threadpool_limits(1, user_api="blas")
