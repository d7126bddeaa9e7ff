"""Exit codes of the command line; `plateau --help` lists them."""

from enum import IntEnum
from typing import Final

from plateau.farm.model.states import JobState


class ExitCode(IntEnum):
    """What a command's exit code means."""

    OK = 0  #: success; the job that was waited for converged or reached its limit
    FAILED = 1  #: the command or the job failed; standard error says why
    USAGE = 2  #: the command line is invalid, or two images cannot be compared
    MISSED = 3  #: some jobs of the batch ended before their rule stopped them
    CANCELLED = 4  #: the job, or a job of the batch, was cancelled
    #: This version does not fit the farm's data or its other processes. A restart does not help.
    INCOMPATIBLE = 76
    INTERRUPTED = 130  #: Ctrl-C: 128 + SIGINT, as in shells


#: The exit code for the state in which a job ended.
EXIT_CODES: Final = {
    JobState.CONVERGED: ExitCode.OK,
    JobState.EXHAUSTED: ExitCode.OK,
    JobState.CANCELLED: ExitCode.CANCELLED,
    JobState.FAILED: ExitCode.FAILED,
}
