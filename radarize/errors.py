"""The one exception that users meet."""


class InputError(Exception):
    """Something the user supplied cannot be used.

    Its text is one sentence that names the file or field, the value found and what was expected; the command
    lines print it and exit with code 2. What a file holds may be part of it: nothing in there reaches a terminal but
    as printable characters.
    """

    def __str__(self) -> str:
        return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in super().__str__())


def reason(error: Exception) -> str:
    """What a library or the system says went wrong with a file, in a few printable words."""
    text = str(error)
    if "No space left" in text or "errno = 28" in text:
        return "no space left on the device"
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    line = " ".join("".join(c if c.isprintable() else " " for c in text).split())
    return line[:120] or type(error).__name__
