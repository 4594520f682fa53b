"""A job, what one hears of it, and how it is tried."""

import os
import traceback
from collections.abc import Callable
from dataclasses import dataclass

from radarize.io.errors import DEBUG, DiskFull, InputError, disk_full, first_line, of_system

#: Takes how far a job is, in units of its own.
Report = Callable[[float], None]
Job = Callable[[Report], object]


@dataclass(frozen=True)
class News:
    """What is heard of a job.

    Attributes:
        name: of the job.
        done: what it reported last.
        ended: no more is heard of it.
        result: of a job that ended well.
        error: why it failed, one sentence.
        full: whether it failed for want of space on the disk.
    """

    name: str
    done: float = 0.0
    ended: bool = False
    result: object = None
    error: str | None = None
    full: bool = False

    @property
    def failure(self) -> InputError:
        """Why it failed, to raise."""
        return (DiskFull if self.full else InputError)(self.error)


def attempt(name: str, job: Job, report: Report) -> News:
    """Do a job here; a failure is news, too: an internal error, whose place --debug shows, if nobody expects it."""
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
