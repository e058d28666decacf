"""`lidarcheck --install-completion`: completion for the shell that is running, or the one that is named."""

from __future__ import annotations

from typing import Literal

from lidarcheck.cli.core.terminal import emit
from lidarcheck.errors import UsageError

__all__ = ["install_completion"]


def install_completion(*, shell: Literal["bash", "zsh", "fish"] | None = None) -> int:
    """Write the completion script to where the shell looks for it.

    Parameters
    ----------
    shell
        The shell; the one that is running by default.
    """
    from cyclopts.completion.detect import ShellDetectionError

    from lidarcheck.cli.core.app import make_app

    try:
        path = make_app().install_completion(shell=shell)
    except ShellDetectionError as error:
        raise UsageError("cannot tell which shell is running", fix="name it with --shell bash, zsh or fish") from error
    emit(f"completion is in {path}; start a new shell to use it")
    return 0
