"""A worker that answers when the test says, with numbers that follow from the files that it is handed."""

import os
import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from lidarcheck.calibration.number.number import Number, Residual
from lidarcheck.formats.lut import load_lut
from lidarcheck.reading import reading
from lidarcheck.session.ticket import Outcome
from lidarcheck.session.worker import Worker

ROW = 3


@dataclass
class Asked:
    how: str
    request: Any
    edited: dict
    on_progress: Any
    on_done: Any
    on_gone: Any
    priority: int
    live: bool = True

    @property
    def file(self):
        return self.request.measured[0].name


class FakeWorker(Worker):
    """`waiting`: what has no answer yet; `asked`: all that was asked for, as (how, file, priority); `seconds`: how
    long each is said to have taken.
    """

    def __init__(self):
        super().__init__()
        self.waiting, self.asked, self.seconds, self.closed = [], [], 0.1, False

    def start(self):
        pass

    def submit(self, entry, arguments, edited, on_progress, on_done, *, on_gone, lane, priority):
        ticket = Asked(entry.rpartition(":")[2], arguments[0], dict(edited), on_progress, on_done, on_gone, priority)
        self.waiting.append(ticket)
        self.asked.append((ticket.how, ticket.file, priority))
        return ticket

    def cancel(self, ticket):
        if ticket in self.waiting:
            self.waiting.remove(ticket)
            ticket.live = False
            ticket.on_gone()

    def close(self):
        self.closed = True

    def samples(self):
        return [ticket for ticket in self.waiting if ticket.how == "sample"]

    def answer(self, of="", how="", failed=""):
        """Answer all that waits, of a measurement and of a kind where these are given; how many."""
        found = [ticket for ticket in self.waiting if of in ticket.file and how in ticket.how]
        for ticket in sorted(found, key=lambda ticket: ticket.priority):
            if ticket in self.waiting:
                self.waiting.remove(ticket)
                ticket.live = False
                with reading(ticket.edited) as read:
                    value = None if failed else number_of(ticket.how, ticket.request)
                ticket.on_done(Outcome(value, failed, self.seconds, dict(read.files), frozenset(read.taken)))
        return len(found)

    def tell(self, done, of, words="seeds"):
        """How far all that waits is."""
        for ticket in self.waiting:
            ticket.on_progress(done, of, words)


def number_of(how, request):
    """Better the more of the table's row is there at 69 m, and worse at all other distances."""
    y = load_lut(request.lut).tables[request.axis].rows()[ROW].scaled if request.lut else 500
    sign = 1 if "69m" in request.measured[0].name else -1
    value = 3.0 - sign * (y - 400) / 500
    left_out = value + 0.001 * np.array([1.0, -1.0, 0.0])
    exact = how != "expected"
    parts = {"PEAK": value, "AREA": value, "WIDTH": value}
    sample = f"7 200 beams x {request.seeds}"
    name = os.fspath(request.measured[0])
    offset = np.array([-30.0, 0.0, 30.0])
    off = {part: np.array([value, 0.0, -value]) for part in parts}
    residual = Residual(offset, off, dict.fromkeys(parts, np.full(3, 0.1)))
    return Number(
        request.kind, value, 0.4, parts, sample, left_out, "columns", name, str(value), exact=exact, residual=residual
    )


def second_line(text):
    """(the number in the second line, the line itself) of a screen as text."""
    shown = text.splitlines()[1]
    found = re.search(r"(?:misfit|gap) (~?[\d.]+)", shown)
    return ("" if found is None else found[1]), shown
