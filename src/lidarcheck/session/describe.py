"""What a result was computed from, in lines for whoever wants to know, or to make it again."""

from __future__ import annotations

import os
import time
from typing import TYPE_CHECKING

from lidarcheck.session.digests import GONE, UNKNOWN

if TYPE_CHECKING:
    from lidarcheck.session.inputs import Inputs
    from lidarcheck.session.node import Derived, Node
    from lidarcheck.session.session import Session

__all__ = ["described"]

_DIGITS = 12
"""Of a hash: enough to tell files apart."""
_OF_VALUE = ("sample", "seeds")
"""What a value may say of itself."""


def described(session: Session, node: Node) -> list[str]:
    """State, files with the hashes of what was read, edit, facts, how long it took, key, and the command that makes the
    same from the saved files. Paths are whole.
    """
    word, derived = session.status(node)
    inputs = session.inputs()
    lines = [_line("state", word or "not computed yet")]
    lines += _files(node, derived, inputs)
    if derived is not None:
        step = session.step(derived.edit)
        about = f"{step.about}: {step.what}" if step.about else step.what
        lines.append(_line("edit", f"{derived.edit}, {about}"))
    facts = [*node.facts, *_facts_of(derived)]
    lines += [_line(name, value) for name, value in facts]
    if derived is not None:
        when = time.strftime("%Y-%m-%d %H:%M", time.localtime(derived.when))
        lines += [_line("took", f"{derived.seconds:.2g} s, at {when}"), _line("key", derived.key[: 2 * _DIGITS])]
    if node.command:
        edited = session.edited_of(inputs.with_named(node.files))
        lines.append(_line("command", node.command))
        lines += [_line("", "it reads the saved files: save first, to make the same")] if edited else []
    return lines


def _files(node: Node, derived: Derived | None, inputs: Inputs) -> list[str]:
    """Each file, with the hash of what was read; what it is now besides."""
    now = {os.path.realpath(name): inputs.digest(name, wait=False) for name in inputs.with_named(node.files)}
    files = now if derived is None else {name: derived.files[name] for name in sorted(derived.files)}
    lines: list[str] = []
    for name, digest in files.items():
        words = [name, "gone" if digest == GONE else "not read yet" if digest == UNKNOWN else digest[:_DIGITS]]
        words += ["now another"] if inputs.digest(name, wait=False) != digest else []
        words += ["edited, not saved"] if name in inputs.edited else []
        lines.append(_line("" if lines else "files", "  ".join(words)))
    return lines


def _facts_of(derived: Derived | None) -> list[tuple[str, str]]:
    value = None if derived is None else derived.value
    found = [(name, getattr(value, name, None)) for name in _OF_VALUE]
    return [(name, str(one)) for name, one in found if isinstance(one, str | int) and str(one)]


def _line(name: str, words: str) -> str:
    return f"{name:9}{words}"
