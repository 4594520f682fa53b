import errno
import pickle

import pytest

from radarize.io.errors import DiskFull, InputError, disk_full, explained, reason
from radarize.io.jobs import attempt


def test_a_sentence_is_one_printable_line_of_bounded_length():
    error = InputError("a.cfg: board is \x1b[2J\nx\0, expected one of äß")
    assert str(error) == "a.cfg: board is \\x1b[2J\\nx\\x00, expected one of äß"
    long = str(InputError("a.cfg: numLoops is " + "9" * 5000 + ", expected 1 to 255"))
    assert len(long) < 1010 and long.startswith("a.cfg: numLoops is 99") and long.endswith("9, expected 1 to 255")


def test_reasons_of_libraries():
    assert reason(OSError(13, "Permission denied")) == "Permission denied"
    assert reason(RuntimeError("Can't read\n  (errno = 28)")) == "no space left on the device"
    assert reason(ValueError("bad\x07 magic\n" + "x" * 500)) == ("bad magic " + "x" * 500)[:120]
    assert reason(StopIteration()) == "StopIteration"


def fails(error: Exception):
    """A job that raises an error while it writes, with a message of its own."""

    def job(report):
        with explained("x.h5: schade", type(error)):
            raise error

    return job


@pytest.mark.parametrize(
    ("error", "full"),
    [
        (OSError(errno.ENOSPC, "Auf dem Gerät ist kein Speicherplatz mehr verfügbar"), True),
        (RuntimeError("file write failed: errno = 28, error message = 'x', total write size = 2"), True),
        (OSError(errno.EACCES, "no space left on device for you"), False),
        (RuntimeError("errno = 281"), False),
    ],
)
def test_a_full_disk_is_known_by_its_number(error, full):
    """A full disk is recognised from the system's error, in any language, in the sentence and across processes."""
    news = pickle.loads(pickle.dumps(attempt("a", fails(error), print)))
    assert news.full == full and isinstance(news.failure, DiskFull) == full
    assert news.error.startswith("x.h5: schade") and disk_full(error) == full
