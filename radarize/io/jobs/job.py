"""Types of parallel jobs, and running a single one."""

import os
import traceback
from collections.abc import Callable
from dataclasses import dataclass

from radarize.io.errors import DEBUG, DiskFull, InputError, disk_full, first_line, of_system

#: Reports the progress of a job, in units of its own.
Report = Callable[[float], None]
Job = Callable[[Report], object]


@dataclass(frozen=True)
class News:
    """A report on a job.

    Attributes:
        name: name of the job.
        done: latest progress.
        ended: whether the job has ended; the last report has True.
        result: return value of a successful job.
        error: reason of a failure, one sentence.
        full: whether it failed because the disk is full.
    """

    name: str
    done: float = 0.0
    ended: bool = False
    result: object = None
    error: str | None = None
    full: bool = False

    @property
    def failure(self) -> InputError:
        """The failure as an exception, to raise."""
        return (DiskFull if self.full else InputError)(self.error)


def attempt(name: str, job: Job, report: Report) -> News:
    """Run a job in this process; a failure is returned, unexpected ones as internal errors (traceback with --debug)."""
    try:
        return News(name, ended=True, result=job(report))
    except InputError as error:
        return News(name, ended=True, error=str(error), full=disk_full(error))
    except OSError as error:
        return News(name, ended=True, error=f"{name}: {of_system(error)}", full=disk_full(error))
    except Exception as error:  # one broken job must not end the others
        if DEBUG in os.environ:
            traceback.print_exc()
        sentence = f"{name}: internal error, {type(error).__name__}: {first_line(error)}"
        return News(name, ended=True, error=sentence, full=disk_full(error))
