"""From arguments to an exit code: the one place that turns whatever happens into a line and a number.

0: done, or every KPI holds. 1: a KPI fell out. 2: could not run. 130: interrupted. 141: nobody reads the output.
143: told to end.
"""

from __future__ import annotations

import atexit
import codecs
import contextlib
import errno
import gc
import os
import signal
import sys
import threading
import warnings
from collections.abc import Sequence
from pathlib import Path

from cyclopts.exceptions import CycloptsError

from lidarcheck.cli.core.terminal import complain, logs_on_stderr
from lidarcheck.cli.core.usage import explain_usage
from lidarcheck.errors import InputError, LidarcheckError, UsageError

__all__ = ["main"]

COULD_NOT_RUN = 2
SPELLED_OUT = "lidarcheck.spelled_out"
"""How an output that holds no more than ASCII gets a sign that it lacks."""
_SIGNS = {
    "\u2212": "-", "\u2026": "...", "\u00b0": " deg", "\u2713": "ok", "\u2205": "-", "\u00d7": "x", "\u00b1": "+-",
    "\u00b2": "^2", "\u2192": "->", "\u00b7": ".", "\u2013": "-",
}  # fmt: skip
INTERRUPTED = 130
NO_READER = 141
TERMINATED = 143
_AGAIN_S = 0.05
"""Longer than the callback takes to return, in which it would be lost once more."""


class Terminated(KeyboardInterrupt):
    """Somebody asked the process to end; it cleans up as it does when it is interrupted."""


def _terminate(*_: object) -> None:
    raise Terminated


def _raise_again(lost: sys.UnraisableHookArgs) -> None:
    """A signal whose exception was lost in a callback, as LLVM has when it compiles, is raised again a moment later."""
    if lost.exc_type is not None and issubclass(lost.exc_type, KeyboardInterrupt):
        number = signal.SIGTERM if issubclass(lost.exc_type, Terminated) else signal.SIGINT
        later = threading.Timer(_AGAIN_S, os.kill, (os.getpid(), number))
        later.daemon = True
        later.start()
    else:
        sys.__unraisablehook__(lost)


def _spelled_out(error: UnicodeError) -> tuple[str, int]:
    """Usual signs in ASCII letters; others as their code."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    text = error.object[error.start : error.end]
    return "".join(_SIGNS.get(c) or ascii(c)[1:-1] for c in text), error.end


codecs.register_error(SPELLED_OUT, _spelled_out)
# At the end of the process all memory goes at once: to look for rubbish in it first takes half a second.
atexit.register(gc.freeze)
_RUBBISH_AFTER = 10_000
"""Objects. What is loaded and compiled stays: to look through it after each 700, as Python does, takes a fifth of the
time that compiling takes, and a twentieth of each start."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command line, `sys.argv` by default, and return its exit code.

    Results go to standard output, all else to standard error. Never raises for what a user did.
    """
    if argv is None:
        # Numeric warnings of the libraries below mean nothing to a user; the package says what it has to say itself.
        warnings.simplefilter("ignore")
        gc.set_threshold(_RUBBISH_AFTER)
        signal.signal(signal.SIGTERM, _terminate)
        sys.unraisablehook = _raise_again
    _provide_streams()
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors=SPELLED_OUT)
    with logs_on_stderr():
        try:
            code = _run(sys.argv[1:] if argv is None else list(argv))
            sys.stdout.flush()
        except Terminated:
            return TERMINATED
        except KeyboardInterrupt:
            return INTERRUPTED
        except BrokenPipeError:
            return _no_reader()
        except LidarcheckError as error:
            return _say(error)
        except OSError as error:
            return _no_reader() if error.errno == errno.EPIPE else _say(_system_error(error))
        except MemoryError:
            return _say(UsageError("there is not enough memory for this", fix="use smaller input, or fewer --jobs"))
        except Exception as error:  # noqa: BLE001 - a bug must not show a user a traceback
            return _internal(error)
    return code


def _provide_streams() -> None:
    """A service may start us without standard streams; what we say there is for nobody, and no reason to fail."""
    for name in ("stdin", "stdout", "stderr"):
        if getattr(sys, name) is None:
            mode = "r" if name == "stdin" else "w"
            setattr(sys, name, Path(os.devnull).open(mode, encoding="utf-8"))  # noqa: SIM115 - open to the end


def _run(argv: list[str]) -> int:
    """The command's exit code. A `SystemExit` of the parser, as from `--help`, is one too."""
    from lidarcheck.cli.core.app import make_app
    from lidarcheck.cli.core.command import ARGUMENTS
    from lidarcheck.formats.limits import own_limit
    from lidarcheck.permissions import Permissions, granted
    from lidarcheck.reading import reading

    app = make_app()
    given = ARGUMENTS.set(tuple(argv))
    try:
        with reading(), own_limit(), granted(Permissions()):  # nothing, until the arguments say so
            result = app(_lone_hyphens(argv), exit_on_error=False, print_error=False, result_action="return_value")
    except CycloptsError as error:
        raise explain_usage(error) from error
    except SystemExit as error:
        if isinstance(error.__context__, BrokenPipeError):  # rich turns it into an exit of its own
            raise error.__context__ from None
        return error.code if isinstance(error.code, int) else 0
    finally:
        ARGUMENTS.reset(given)
    return result if isinstance(result, int) else 0


def _lone_hyphens(argv: list[str]) -> list[str]:
    """`--json -` as `--json=-`: the parser takes a value that begins with a hyphen for an option."""
    joined: list[str] = []
    for argument in argv:
        if argument == "-" and joined and joined[-1] == "--json":
            joined[-1] = "--json=-"
        else:
            joined.append(argument)
    return joined


def _say(error: LidarcheckError) -> int:
    if os.environ.get("LIDARCHECK_DEBUG"):
        _traceback(error)
    for line in error.lines():
        complain(line)
    return error.exit_code


def _system_error(error: OSError) -> InputError:
    what = error.strerror or str(error) or type(error).__name__
    return InputError(what[:1].lower() + what[1:], file=error.filename, fix=_remedy(error))


def _remedy(error: OSError) -> str:
    remedies = {
        errno.ENOSPC: "free some space, then run it again",
        errno.EACCES: "check its permissions",
        errno.EPERM: "check its permissions",
        errno.ENOENT: "check the path",
        errno.EROFS: "choose a place that can be written",
    }
    return remedies.get(error.errno or 0, "")


def _internal(error: Exception) -> int:
    if os.environ.get("LIDARCHECK_DEBUG"):
        _traceback(error)
    what = " ".join(str(error).split()) or "no message"
    complain(
        f"error: internal error, {type(error).__name__}: {what[:200]}; "
        "please report it with the output that LIDARCHECK_DEBUG=1 adds"
    )
    return COULD_NOT_RUN


def _traceback(error: BaseException) -> None:
    import traceback

    sys.stderr.write("".join(traceback.format_exception(error)))


def _no_reader() -> int:
    """Leave quietly: the interpreter would complain once more while it closes standard output."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return NO_READER
