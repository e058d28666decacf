"""The process that runs somebody else's function; it knows nothing of lidarcheck, and starts with numpy alone.

Run as `python -P module_worker.py DIRECTORY package.module:function`. Of the project nothing but the package can be
imported: what trust was asked for is its text.
"""

from __future__ import annotations

import difflib
import importlib
import importlib.machinery
import importlib.util
import inspect
import json
import os
import sys
import traceback
from collections.abc import Callable, Mapping
from types import CodeType
from typing import IO, Any

import numpy as np
import numpy.typing as npt

Columns = Mapping[str, npt.NDArray[Any]]
_NUMBERS = "biuf"
_LONGEST = 1000
"""Characters of what is said of a fault: an exception may hold a whole array."""


def packed(words: Mapping[str, Any], columns: Columns) -> bytes:
    """A message: a JSON object in a line, then the bytes of each column."""
    arrays = {name: np.ascontiguousarray(column) for name, column in columns.items()}
    head = {**words, "columns": [[name, one.dtype.str, len(one)] for name, one in arrays.items()]}
    return b"".join([json.dumps(head).encode(), b"\n", *(one.tobytes() for one in arrays.values())])


class _Fault(Exception):
    """What is wrong with the function, where, and what to do."""

    def __init__(self, what: str, fix: str = "", file: str | None = None, line: int | None = None) -> None:
        super().__init__(what)
        self.words = {"error": what[:_LONGEST], "fix": fix, "file": file, "line": line}


class _FromText(importlib.machinery.SourceFileLoader):
    """Compiles a module's text each time: what was compiled before may be of other text of the same second."""

    def get_code(self, fullname: str) -> CodeType:
        """As Python's import asks for it."""
        path = self.get_filename(fullname)
        return self.source_to_code(self.get_data(path), path)


class _OnlyPackage:
    """Finds one package or module in a folder, and nothing else there."""

    def __init__(self, name: str, folder: str) -> None:
        self._name, self._folder = name, folder

    def find_spec(self, fullname: str, path: Any = None, target: Any = None) -> importlib.machinery.ModuleSpec | None:
        """As Python's import asks for it."""
        if fullname != self._name and not (path and fullname.startswith(f"{self._name}.")):
            return None
        found = importlib.machinery.PathFinder.find_spec(fullname, path or [self._folder])
        if found is None:
            return None
        if found.submodule_search_locations is not None:
            found.submodule_search_locations = list(found.submodule_search_locations)
        if type(found.loader) is importlib.machinery.SourceFileLoader and str(found.origin).startswith(self._folder):
            found.loader = _FromText(fullname, found.loader.path)
        return found


class _Model:
    """The function, and which keywords it takes."""

    def __init__(self, folder: str, words: str) -> None:
        module, _, name = words.partition(":")
        self._package = module.partition(".")[0]
        sys.meta_path.insert(0, _OnlyPackage(self._package, folder))
        self._function = self._loaded(module, name, folder)
        self._signature = inspect.signature(self._function)

    def _loaded(self, module: str, name: str, folder: str) -> Callable[..., Any]:
        try:
            found = importlib.import_module(module)
        except ModuleNotFoundError as error:
            if error.name and (module == error.name or module.startswith(f"{error.name}.")):
                fix = f"put it beside the model file, in {folder}, or install it"
                raise _Fault(f"cannot be found: there is no module {error.name}", fix) from error
            fix = "install it, or move it into the package: nothing else of the project is imported"
            raise self._raised(error, "cannot be loaded: ", fix) from error
        except BaseException as error:
            raise self._raised(error, "cannot be loaded: ") from error
        function = getattr(found, name, None)
        if callable(function):
            return function  # type: ignore[no-any-return]
        near = difflib.get_close_matches(name, [one for one in vars(found) if callable(vars(found)[one])], 1)
        what = f"has no function {name}" if function is None else f"names {name}, which is no function"
        raise _Fault(what, f"did you mean {near[0]}?" if near else "", getattr(found, "__file__", None))

    def echoes(self, asked: Mapping[str, Any], ideal: Columns) -> Columns:
        """What the function gives for an ideal scan."""
        own = self._signature.parameters
        takes_all = any(one.kind is inspect.Parameter.VAR_KEYWORD for one in own.values())
        offered = {name: asked[name] for name in ("seed", "frame", "ini") if name in own or takes_all}
        keywords = {**{name: value for name, value in offered.items() if value is not None}, **asked["parameters"]}
        try:
            self._signature.bind(ideal, **keywords)
        except TypeError as error:
            raise self._fault(f"cannot be called with {', '.join(['the ideal scan', *keywords])}: {error}") from error
        try:
            return self._checked(self._function(ideal, **keywords))
        except _Fault:
            raise
        except BaseException as error:
            raise self._raised(error) from error

    def _checked(self, found: Any) -> Columns:
        if not isinstance(found, Mapping):
            raise self._fault(f"returned a {type(found).__name__}, not a dict of columns")
        columns = {}
        for name, values in found.items():
            column = np.asarray(values)
            if column.dtype.kind not in _NUMBERS or column.dtype.itemsize > 8:
                raise self._fault(f"returned a column {name} of {column.dtype}, not of numbers")
            if column.ndim != 1:
                raise self._fault(f"returned a column {name} of shape {column.shape}; a column has a number a row")
            columns[str(name)] = column
        lengths = {name: len(column) for name, column in columns.items()}
        if len(set(lengths.values())) > 1:
            (few, least), (many, most) = (pick(lengths.items(), key=lambda one: one[1]) for pick in (min, max))
            raise self._fault(f"returned {least} rows of {few} and {most} of {many}; columns are equally long")
        return columns

    def _fault(self, what: str) -> _Fault:
        code = getattr(inspect.unwrap(self._function), "__code__", None)
        return _Fault(what, "", code and code.co_filename, code and code.co_firstlineno)

    def _raised(self, error: BaseException, begin: str = "", fix: str = "") -> _Fault:
        """An exception, at the innermost line of the package's own text."""
        what = f"{begin}{type(error).__name__}: {error}" if begin else f"raised {type(error).__name__}: {error}"
        if isinstance(error, SyntaxError) and error.filename:
            return _Fault(f"{begin}SyntaxError: {error.msg}", fix, error.filename, error.lineno)
        frames = traceback.extract_tb(error.__traceback__)
        own = [one for one in frames if self._is_own(one.filename)] or frames[-1:]
        return _Fault(what, fix, own[-1].filename if own else None, own[-1].lineno if own else None)

    def _is_own(self, file: str) -> bool:
        """Whether a file is the package's own text."""
        found = importlib.util.find_spec(self._package)
        places = [] if found is None else [*(found.submodule_search_locations or ()), found.origin or ""]
        return any(file == place or file.startswith(f"{place}{os.sep}") for place in places if place)


def _serve(folder: str, words: str, requests: IO[bytes], answers: IO[bytes]) -> None:
    """Answer requests until there are no more."""

    def answer(data: bytes) -> None:
        answers.write(data)
        answers.flush()

    try:
        model = _Model(folder, words)
    except _Fault as fault:
        answer(packed(fault.words, {}))
        return
    answer(packed({}, {}))
    while line := requests.readline():
        asked = json.loads(line)
        ideal = {
            name: np.frombuffer(requests.read(np.dtype(kind).itemsize * n), kind) for name, kind, n in asked["columns"]
        }
        try:
            answer(packed({}, model.echoes(asked, ideal)))
        except _Fault as fault:
            answer(packed(fault.words, {}))


def main() -> None:
    """Keep the pipes to ourselves: what the function prints goes to standard error, what it reads is nothing."""
    requests, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.dup2(2, 1)
    _serve(sys.argv[1], sys.argv[2], requests, answers)


if __name__ == "__main__":
    main()
