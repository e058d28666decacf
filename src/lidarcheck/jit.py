"""Compiling kernels: numba, with a cache that a changed source cannot outlive.

Numba renews a cached function when its own file changes, but not when a function that it calls from another file does;
a gate on such a cache would pass a changed model. So the cache directory is named by a hash of all the model's source,
the elementary functions among it: the fast path's library of echoes lies under the same hash.
"""

from __future__ import annotations

import atexit
import contextlib
import hashlib
import logging
import os
import shutil
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba import types

from lidarcheck import jit_parts

__all__ = ["base_directory", "cache_directory", "inlined", "kernel", "source_hash"]

_KEPT_CACHES = 6
_ROOM_BYTES = 1 << 22
_log = logging.getLogger(__name__)
_F = TypeVar("_F", bound=Callable[..., Any])


@cache
def source_hash() -> str:
    """SHA-256 over the package's source files that kernels are compiled from, and numba's version."""
    root = Path(__file__).resolve().parent
    digest = hashlib.sha256(numba.__version__.encode())
    for path in _sources(root):
        digest.update(path.relative_to(root).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _sources(root: Path) -> list[Path]:
    """What kernels and the echoes kept beside them are made with; searches and other programs have no part in that."""
    found = (path for part in ("elementary", "model", "effects") for path in (root / part).rglob("*.py"))
    kept = (path for path in found if not {"search", "external"} & set(path.relative_to(root).parts))
    return sorted([Path(__file__).resolve(), Path(jit_parts.__file__).resolve(), *kept])


@cache
def cache_directory() -> Path:
    """Where this source's compiled kernels lie: below `LIDARCHECK_CACHE`, else the user's cache directory.

    Where neither can be written, a temporary directory, gone when the process ends.
    """
    try:
        base = base_directory() / "kernels"
        directory = base / source_hash()[:16]
        directory.mkdir(parents=True, exist_ok=True)
        directory.touch()
        _check_room(directory)
    except (OSError, RuntimeError) as error:  # RuntimeError: there is no home directory
        place = getattr(error, "filename", None) or "the cache directory"
        _log.warning("%s cannot be written: kernels are compiled anew in each run; set LIDARCHECK_CACHE", place)
        scratch = tempfile.mkdtemp(prefix="lidarcheck-kernels-")
        atexit.register(shutil.rmtree, scratch, ignore_errors=True)
        return Path(scratch)
    _prune(base)
    return directory


def _check_room(directory: Path) -> None:
    """Raise `OSError` where an empty cache could not take the kernels."""
    if not any(directory.iterdir()):
        with tempfile.NamedTemporaryFile(dir=directory) as probe:
            try:
                probe.write(bytes(_ROOM_BYTES))
                probe.flush()
            except OSError as error:
                raise OSError(error.errno, error.strerror, str(directory)) from error


def base_directory() -> Path:
    """Below which caches lie: `LIDARCHECK_CACHE`, else the user's cache directory."""
    given = os.environ.get("LIDARCHECK_CACHE")
    if given:
        return Path(given)
    shared = os.environ.get("XDG_CACHE_HOME")
    return (Path(shared) if shared else Path.home() / ".cache") / "lidarcheck"


def _prune(base: Path) -> None:
    """Remove the caches of sources that have not been run for longest; others may do so at the same time."""
    caches: list[tuple[float, Path]] = []
    with contextlib.suppress(OSError):
        for path in base.iterdir():
            with contextlib.suppress(OSError):
                if path.is_dir():
                    caches.append((path.stat().st_mtime, path))
    for _, path in sorted(caches)[:-_KEPT_CACHES]:
        shutil.rmtree(path, ignore_errors=True)


class CachePlace:
    """Where numba keeps a compiled kernel: named by its module and the file's bytes, wherever the file lies.

    numba's own place is named by the directory of the file, so that every copy of a source would be compiled anew. The
    methods are those that numba asks for.
    """

    def __init__(self, function: Callable[..., Any], file: str) -> None:
        self._py_file = file  # numba names it where it warns that a function cannot be kept
        self._stamp = hashlib.sha256(Path(file).read_bytes()).hexdigest()
        self._path = cache_directory() / f"{function.__module__}_{self._stamp[:16]}"
        self._line = function.__code__.co_firstlineno

    @classmethod
    def from_function(cls, function: Callable[..., Any], file: str) -> CachePlace | None:
        """The place; none for what lies in no file of its own, which numba finds a place for."""
        return cls(function, file) if Path(file).is_file() else None

    def get_cache_path(self) -> str:
        """The directory."""
        return str(self._path)

    def ensure_cache_path(self) -> None:
        """Make the directory."""
        self._path.mkdir(parents=True, exist_ok=True)

    def get_source_stamp(self) -> str:
        """What a kernel must have been compiled from."""
        return self._stamp

    def get_disambiguator(self) -> str:
        """What tells functions of one name apart."""
        return str(self._line)


_PLACES = f"{__name__}.{CachePlace.__name__},UserProvidedCacheLocator"
_OPTIONS: dict[str, Any] = {
    "cache": True,
    "nogil": True,
    "error_model": "numpy",
    "_nrt": False,
    "no_cfunc_wrapper": True,
}
"""No reference counts: kernels allocate nothing, and counting the arrays they pass took a third of their time. No entry
for callers in C: there are none."""


def kernel(function: _F) -> _F:
    """Compile to machine code without the interpreter's lock, exact IEEE arithmetic, cached on disk.

    A kernel must not allocate: it works in arrays that its caller brings. Nor may it call itself.
    """
    return _compiled(function, inlined=False)


def inlined(function: _F) -> _F:
    """Like `kernel`, for one that is called once a beam: pasted into its caller, since passing arrays costs as well."""
    return _compiled(function, inlined=True)


def _compiled(function: _F, *, inlined: bool) -> _F:
    settings: Any = numba.config
    in_parts = jit_parts.are_possible()
    # By LLVM, or else by numba, which pastes the source and finds its types once more at each place of call.
    how: dict[str, Any] = {"forceinline": True} if in_parts else {"inline": "always"}
    before = settings.CACHE_DIR, getattr(settings, "CACHE_LOCATOR_CLASSES", "")
    settings.CACHE_DIR, settings.CACHE_LOCATOR_CLASSES = str(cache_directory()), _PLACES
    try:
        compiled: Any = numba.njit(**_OPTIONS, **(how if inlined else {}))(function)
    finally:
        settings.CACHE_DIR, settings.CACHE_LOCATOR_CLASSES = before
    if hasattr(compiled, "get_call_template"):  # the GPU's simulator runs plain Python
        if in_parts:
            jit_parts.as_part(compiled)
        _compile_alike(compiled)
    return cast(_F, compiled)


def _compile_alike(compiled: Any) -> None:
    """Take a literal, such as 0, for any number of its type: a kernel is else compiled once more for it."""
    template, plain = compiled.get_call_template, cast(Any, types.unliteral)

    def of_plain_types(args: Any, keywords: Any) -> Any:
        return template(tuple(map(plain, args)), {name: plain(kind) for name, kind in dict(keywords).items()})

    compiled.get_call_template = of_plain_types
