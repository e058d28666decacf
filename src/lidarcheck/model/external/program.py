"""Somebody else's model as a program that runs once for each ideal scan."""

from __future__ import annotations

import dataclasses
import logging

from lidarcheck.model.external.command import check_command, filled, names_in
from lidarcheck.model.external.echoes import echoes_in
from lidarcheck.model.external.exchange import Request, Run, write_ideal, write_settings
from lidarcheck.model.external.process import Child, Groups, exit_words, failure, last_words, scratch_directory
from lidarcheck.model.spec import External
from lidarcheck.scan import Scan
from lidarcheck.sensor import Sensor

__all__ = ["run_program"]

_log = logging.getLogger(__name__)


def run_program(request: Request, external: External, sensor: Sensor | None, groups: Groups) -> Scan:
    """Start the program, wait for its end, read the scan that it wrote.

    The ideal scan is text in a temporary directory; the command's placeholders are filled, and it runs without a shell
    in `external.directory`. Without an `ini` of its own, the command gets one that holds the seed. On a timeout or an
    interrupt its whole process group is killed. `ExternalModelError`, with the command and the last line of its
    standard error, when it cannot be started, fails, takes longer than `timeout_s`, or leaves no readable scan.
    """
    for _, fault in check_command(external.command, request.parameters):
        raise fault
    with scratch_directory() as directory:
        ideal, scan = directory / "ideal.txt", directory / "scan.txt"
        write_ideal(request, ideal, external)
        ini = write_settings(request, directory / "settings.ini", external, names_in(external.command))
        run = Run(ideal, ini, scan)
        values = {**request.parameters, **dataclasses.asdict(run), "seed": request.seed, "frame": request.frame}
        child = Child(
            [filled(argument, values) for argument in external.command], external, directory, pipes=False, groups=groups
        )
        try:
            code = child.wait(external.timeout_s)
        finally:
            child.end()
        said = last_words(child.log)
        if code is None:
            what = f"took longer than {external.timeout_s:g} s"
            raise failure(what, external, said, "raise timeout_s or make it faster")
        if code:
            raise failure(exit_words(code), external, said, "run the command by hand")
        if said:
            _log.info("%s said: %s", external.command[0], said)
        return echoes_in(run.scan, external, sensor, said)
