"""What of a page on the disk lidarcheck does not write: such a page is not put onto another one."""

from __future__ import annotations

from html.parser import HTMLParser

__all__ = ["foreign_in"]

_REACHES_OUT = frozenset(
    (
        *("animate", "applet", "audio", "base", "embed", "foreignobject", "form", "frame", "iframe", "img", "input"),
        *(
            "link",
            "math",
            "meta",
            "object",
            "script",
            "set",
            "source",
            "style",
            "template",
            "textarea",
            "track",
            "video",
        ),
    )
)
"""Elements that run, load or send something, look like another page's, or lead elsewhere."""
_ADDRESSES = frozenset(("action", "background", "data", "formaction", "href", "poster", "src", "srcset", "xlink:href"))


class _Parser(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.found = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        name = tag.rpartition(":")[2]
        names = {key for key, value in attrs if key in _ADDRESSES and not (value or "").startswith("#")}
        names |= {key for key, _ in attrs if key.startswith("on")}
        if (name in _REACHES_OUT and not (name == "input" and dict(attrs).get("type") == "radio")) or names:
            self.found = self.found or " ".join([f"<{tag}", *sorted(names)]) + ">"


def foreign_in(html: str) -> str:
    """The first element of the page's content that lidarcheck never writes; empty where there is none."""
    parser = _Parser()
    parser.feed(html)
    parser.close()
    return parser.found
