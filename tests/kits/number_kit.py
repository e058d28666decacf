"""A worker that answers when the test says, with numbers that follow from the files that it is handed."""

import os
import re

import numpy as np

from lidarcheck.calibration.number.number import Number
from lidarcheck.formats.lut import load_lut
from lidarcheck.reading import reading
from lidarcheck.session.worker import Outcome

ROW = 3


class FakeWorker:
    """`asked`: what waits for an answer, as (how, request, edited); `seconds`: how long each is said to have taken."""

    def __init__(self):
        self.waiting, self.asked, self.seconds, self.closed = [], [], 0.1, False

    def submit(self, entry, arguments, edited, on_progress, on_done, *, lane, priority):
        how = entry.rpartition(":")[2]
        ticket = [how, arguments[0], dict(edited), on_progress, on_done, priority]
        self.waiting.append(ticket)
        self.asked.append((how, arguments[0].measured[0].name, priority))
        return ticket

    def cancel(self, ticket):
        if ticket in self.waiting:
            self.waiting.remove(ticket)

    def close(self):
        self.closed = True

    def answer(self, of="", how="", failed=""):
        """Answer all that waits, of a measurement and of a kind where these are given; how many."""
        found = [t for t in self.waiting if of in t[1].measured[0].name and how in t[0]]
        for ticket in sorted(found, key=lambda t: t[5]):
            if ticket in self.waiting:
                self.waiting.remove(ticket)
                value = None if failed else number_of(*ticket[:3])
                ticket[4](Outcome(value, failed, self.seconds))
        return len(found)

    def tell(self, done, of):
        """How far all that waits is."""
        for ticket in self.waiting:
            ticket[3](done, of, "seeds")


def number_of(how, request, edited):
    """Better the more of the table's row is there at 69 m, and worse at all other distances."""
    with reading(edited):
        y = load_lut(request.lut).tables[request.axis].rows()[ROW].scaled if request.lut else 500
    sign = 1 if "69m" in request.measured[0].name else -1
    value = 3.0 - sign * (y - 400) / 500
    left_out = value + 0.001 * np.array([1.0, -1.0, 0.0])
    exact = how != "expected"
    parts = {"PEAK": value, "AREA": value, "WIDTH": value}
    sample = f"7 200 beams x {request.seeds}"
    return Number(request.kind, value, 0.4, parts, sample, left_out, "columns", os.fspath(request.measured[0]),
                  str(value), exact, 0.1)  # fmt: skip


def second_line(text):
    """(the number in the second line, the line itself) of a screen as text."""
    shown = text.splitlines()[1]
    found = re.search(r"(?:misfit|gap) (~?[\d.]+)", shown)
    return ("" if found is None else found[1]), shown
