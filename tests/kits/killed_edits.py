"""A child that edits a LUT file and is killed with signal 9, and what must be true of the file afterwards.

PYTHONPATH=tests python tests/kits/killed_edits.py DIRECTORY TIMES SEED: how often a killed child lost nothing.
"""

import os
import random
import signal
import sys
import time
from pathlib import Path

from lidarcheck.calibration.blooming.lut_edit import inserted, without_rows
from lidarcheck.session.edited_lut import EditedLut
from tui_kit import LUT


def edit_until_killed(root, seed, say):
    """What a user does, faster: edits, undoes and saves at random, and says each once it is done."""
    draw = random.Random(seed)
    session = EditedLut(root / "a_lut.ini", root)
    if session.found:
        session.bring_back()
    say("ready", session.current.content)
    while True:
        chance, lut, history = draw.random(), session.current, session.history
        if chance < 0.3:
            say("saving", lut.content)
            session.save()
            say("saved", session.saved.content)
        elif chance < 0.4 and history.done:
            say("doing", history.last("undo").applied(lut.content, back=True))
            session.undo()
            say("done", session.current.content)
        elif chance < 0.5 and history.undone:
            say("doing", history.last("redo").applied(lut.content))
            session.redo()
            say("done", session.current.content)
        elif chance < 0.6:
            row = draw.randrange(len(lut.tables["vertical"]))
            say("doing", inserted(lut, "vertical", row).content)
            session.insert("vertical", row)
            say("done", session.current.content)
        elif chance < 0.7 and len(lut.tables["vertical"]) > 2:
            row = draw.randrange(len(lut.tables["vertical"]))
            say("doing", without_rows(lut, "vertical", [row]).content)
            session.remove("vertical", [row])
            say("done", session.current.content)
        else:
            row, value = draw.randrange(len(lut.tables["vertical"])), draw.randrange(270, 1000)
            say("doing", lut.with_scaled("vertical", row, value).content)
            session.set("vertical", [row], str(value))
            say("done", session.current.content)


def killed_session(root, seed, after_s):
    """Edit in a child, kill it with signal 9, and give what it said: (word, bytes) in order."""
    receive, send = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(receive)
        edit_until_killed(root, seed, lambda word, content: os.write(send, f"{word} {content.hex()}\n".encode()))
        os._exit(1)
    os.close(send)
    with os.fdopen(receive, "rb") as stream:
        said = stream.readline()
        time.sleep(after_s)
        os.kill(child, signal.SIGKILL)
        said += stream.read()
    os.waitpid(child, 0)
    lines = [line.split() for line in said.decode().split("\n")[:-1]]
    return [(word, bytes.fromhex(content)) for word, content in lines]


def check_killed(root, said, known):
    """Nothing is lost or half-written after a kill: `known` are all contents that were ever to be saved."""
    known.update(content for word, content in said if word == "saving")
    disk = (root / "a_lut.ini").read_bytes()
    assert disk in known, "the file is neither old nor new"
    session = EditedLut(root / "a_lut.ini", root)
    assert not session.read_only, "the lock outlived its holder"
    if session.found:
        session.bring_back()
    # What was being done may be there: it was kept, and the process died before it said so.
    able = [said[-1][1]] if said[-1][0] != "doing" else [said[-1][1], said[-2][1]]
    assert session.current.content in able, f"an edit was lost while {said[-1][0]}"
    session.close()


def kill_often(root, times, seed):
    """Kill a session many times; how often it died after which word."""
    draw, phases, known = random.Random(seed), {}, {LUT.encode()}
    for number in range(times):
        said = killed_session(root, 1000 * seed + number, draw.uniform(0.0, 0.04))
        check_killed(root, said, known)
        phases[said[-1][0]] = phases.get(said[-1][0], 0) + 1
    return phases


if __name__ == "__main__":
    (Path(sys.argv[1]) / "a_lut.ini").write_bytes(LUT.encode())
    print(kill_often(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])))
