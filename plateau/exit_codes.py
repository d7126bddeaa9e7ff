"""Exit codes of the command line; `plateau --help` lists them."""

from enum import IntEnum
from typing import Final

from plateau.farm.model.states import JobState


class ExitCode(IntEnum):
    """What a command's exit code means."""

    OK = 0  #: done; a job that was waited for has converged or is exhausted
    FAILED = 1  #: it could not be done, or the job failed; standard error says why
    USAGE = 2  #: the command line is not right, or two images cannot be compared
    MISSED = 3  #: jobs of the batch that was waited for ended before their rule stopped them
    CANCELLED = 4  #: the job that was waited for was cancelled, or one of the batch
    INCOMPATIBLE = 76  #: a process does not fit the farm's data or its other processes: to start it
    #: again changes nothing, to install another version does
    INTERRUPTED = 130  #: Ctrl-C, as shells count signals


#: How a job's end becomes an exit code.
EXIT_CODES: Final = {
    JobState.CONVERGED: ExitCode.OK,
    JobState.EXHAUSTED: ExitCode.OK,
    JobState.CANCELLED: ExitCode.CANCELLED,
    JobState.FAILED: ExitCode.FAILED,
}
