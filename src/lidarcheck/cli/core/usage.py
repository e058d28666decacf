"""The parser's complaints as lidarcheck says them: one line, what is wrong, what to do."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

from cyclopts import exceptions

from lidarcheck.errors import UsageError

__all__ = ["explain_usage"]


def explain_usage(error: exceptions.CycloptsError) -> UsageError:
    """The same complaint as a `UsageError`, with the nearest option or command where there is one."""
    command = " ".join(("lidarcheck", *(error.command_chain or ())))
    manual = f"see {command} --help"
    if isinstance(error, exceptions.UnknownCommandError):
        return _unknown_command(error)
    if isinstance(error, exceptions.UnknownOptionError):
        given = (error.token.keyword or error.token.value).split("=", 1)[0]
        options = (name for argument in error.argument_collection for name in argument.names if argument.parse)
        return UsageError(f"{command} has no option {given}", fix=_nearest(given, options, manual))
    if isinstance(error, exceptions.UnusedCliTokensError):
        surplus = " ".join(error.unused_tokens or ())
        return UsageError(f"{command} has no use for {surplus!r}", fix=manual)
    if isinstance(error, exceptions.MissingArgumentError) and error.argument is not None:
        return _missing(error, command, manual)
    if isinstance(error, exceptions.RepeatArgumentError):
        return UsageError(f"{error.token.keyword} is given more than once", fix="give it once")
    if isinstance(error, exceptions.CoercionError | exceptions.ValidationError):
        return _bad_value(error, manual)
    return UsageError(_decapitalise(str(error)), fix=manual)


def _unknown_command(error: exceptions.UnknownCommandError) -> UsageError:
    given = (error.unused_tokens or [""])[0]
    names = [name for name in (error.app or ()) if not given.startswith("-") or name.startswith("-")]
    kind = "option" if given.startswith("-") else "command"
    fix = _nearest(given, names, "see lidarcheck --help")
    return UsageError(f"there is no {kind} {given}", fix=fix)


def _missing(error: exceptions.MissingArgumentError, command: str, manual: str) -> UsageError:
    assert error.argument is not None
    name = error.keyword or error.argument.name
    if name.startswith("-") and (error.keyword or error.argument.tokens):
        return UsageError(f"{name} needs a value", fix=manual)
    return UsageError(f"{command} needs {name}", fix=manual)


def _bad_value(error: exceptions.CoercionError | exceptions.ValidationError, manual: str) -> UsageError:
    # A converter or validator of this package raised it: its message says all there is to say.
    cause = error.__cause__
    if isinstance(cause, UsageError):
        return cause
    return UsageError(_decapitalise(str(error)), fix=manual)


def _nearest(given: str, names: Iterable[str], otherwise: str) -> str:
    # Below 0.75, --ideal would suggest --model.
    near = difflib.get_close_matches(given, list(names), n=1, cutoff=0.75)
    return f"did you mean {near[0]}?" if near else otherwise


def _decapitalise(text: str) -> str:
    text = " ".join(text.split()).rstrip(".")
    return text[:1].lower() + text[1:]
