"""The one exception that users meet."""


class InputError(Exception):
    """Something the user supplied cannot be used.

    Its text is one sentence that names the file or field, the value found and what was expected; the command
    lines print it and exit with code 2.
    """
