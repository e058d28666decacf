"""XML of vendors: elements with their lines; documents that define entities are refused before anything is expanded."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.parsers import expat

from lidarcheck.config.words import shown
from lidarcheck.errors import InputError
from lidarcheck.printable import printable

__all__ = ["Element", "xml_root"]

_DEEPEST = 100
_MOST_ELEMENTS = 100_000


@dataclass
class Element:
    """An element: its tag without a prefix, attributes, own text, children, and the line on which it begins."""

    tag: str
    attributes: dict[str, str]
    line: int
    file: Path
    text: str = ""
    children: list[Element] = field(default_factory=list)

    def fault(self, what: str, fix: str = "correct it") -> InputError:
        """The error for a fault of this element, to raise."""
        return InputError(what, file=self.file, line=self.line, fix=fix)

    def all(self, tag: str) -> list[Element]:
        """The children of that tag."""
        return [child for child in self.children if child.tag == tag]

    def find(self, *tags: str) -> Element | None:
        """The first descendant along the tags; None where there is none."""
        at: Element | None = self
        for tag in tags:
            at = None if at is None else next((child for child in at.children if child.tag == tag), None)
        return at

    def within(self) -> Iterator[Element]:
        """This element and all below it, in the document's order."""
        waiting = [self]
        while waiting:
            at = waiting.pop()
            yield at
            waiting.extend(reversed(at.children))

    def number(self, *tags: str, low: float = -math.inf, high: float = math.inf) -> float:
        """The number that is the text of the descendant; `InputError` where there is none, or out of range."""
        at = self.find(*tags)
        if at is None:
            raise self.fault(f"<{'/'.join((self.tag, *tags))}> is missing")
        return at._number(at.text, f"<{at.tag}>", low, high)

    def maybe(self, *tags: str, low: float = -math.inf, high: float = math.inf) -> float | None:
        """The same; None where there is no such element."""
        return None if self.find(*tags) is None else self.number(*tags, low=low, high=high)

    def attribute(self, name: str, *, low: float = -math.inf, high: float = math.inf) -> float | None:
        """The number in an attribute; None where it is not there."""
        text = self.attributes.get(name)
        return None if text is None else self._number(text, f"{name} of <{self.tag}>", low, high)

    def _number(self, text: str, name: str, low: float, high: float) -> float:
        try:
            number = float(text)
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            fix = "expand the macros first" if "${" in text else "use a finite number"
            raise self.fault(f"{name} = {shown(text.strip())} is no number", fix)
        if not low <= number <= high:
            fix = f"use a number from {low:g} to {high:g}" if high < math.inf else f"use a number from {low:g}"
            raise self.fault(f"{name} = {number:g} is out of range", fix)
        return number


def xml_root(text: str, file: Path) -> Element:
    """The root element of an XML document.

    `InputError` with the line where it is not well-formed, has a document type (entities are never expanded), or nests
    too deeply.
    """
    parser = expat.ParserCreate("utf-8")  # whatever the document says of itself: the text has been decoded
    parser.buffer_text = True
    build = _Build(parser, file)
    parser.StartElementHandler = build.start
    parser.EndElementHandler = build.end
    parser.CharacterDataHandler = build.data
    parser.StartDoctypeDeclHandler = build.refuse_doctype
    try:
        parser.Parse(text.encode("utf-8", "surrogatepass"), True)
    except expat.ExpatError as error:
        what = f"not valid XML: {printable(expat.ErrorString(error.code))}"
        raise InputError(what, file=file, line=error.lineno, fix="correct the line") from None
    assert build.root is not None  # expat refuses a document without an element
    return build.root


class _Build:
    def __init__(self, parser: Any, file: Path) -> None:
        self.parser, self.file = parser, file
        self.root: Element | None = None
        self.open: list[Element] = []
        self.count = 0

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        line = self.parser.CurrentLineNumber
        self.count += 1
        if len(self.open) >= _DEEPEST or self.count > _MOST_ELEMENTS:
            what = "elements are nested too deeply" if len(self.open) >= _DEEPEST else "the file has too many elements"
            raise InputError(what, file=self.file, line=line, fix="is this the description of a sensor?")
        element = Element(tag.rpartition(":")[2], attributes, line, self.file)
        if self.open:
            self.open[-1].children.append(element)
        else:
            self.root = element
        self.open.append(element)

    def end(self, _tag: str) -> None:
        self.open.pop()

    def data(self, text: str) -> None:
        at = self.open[-1]
        if not at.children:  # text between children is layout
            at.text += text

    def refuse_doctype(self, *_: object) -> None:
        line = self.parser.CurrentLineNumber
        fix = "remove the document type and write entities out"
        raise InputError("the XML has a DOCTYPE: entities are not expanded", file=self.file, line=line, fix=fix)
