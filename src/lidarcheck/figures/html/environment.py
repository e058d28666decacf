"""What all HTML pages share: the templates with their filters."""

from __future__ import annotations

import re
from functools import cache
from typing import TYPE_CHECKING, Any

from markupsafe import Markup, escape

from lidarcheck.printable import printable, printable_lines

if TYPE_CHECKING:
    from jinja2 import Environment

__all__ = ["breakable", "page_environment"]


@cache
def page_environment() -> Environment:
    """The templates of pages, with their filters."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("lidarcheck.figures", "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        finalize=_printable,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"breakable": breakable, "code": _code}
    return environment


def _printable(value: Any) -> Any:
    """What a template says, but for what it has set itself."""
    return printable_lines(value) if isinstance(value, str) and not isinstance(value, Markup) else value


def breakable(name: str) -> Markup:
    """A name that may be broken behind its dots and underscores, but for a number's."""
    return Markup(re.sub(r"(?<![0-9])[._]|[._](?![0-9])", r"\g<0><wbr>", str(escape(printable(name)))))


def _code(text: str) -> Markup:
    """A text whose `commands` are set as such."""
    return Markup(re.sub("`([^`]+)`", r"<code>\1</code>", str(escape(printable_lines(text)))))
