"""Pydantic's validation errors as one sentence for the user."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from pydantic import ValidationError

from radarize.io.errors import InputError


@contextmanager
def naming(where: str, data: object = None) -> Iterator[None]:
    """Prefix validation errors with the place where they occur; pydantic's errors refer to `data`."""
    try:
        yield
    except ValidationError as error:
        raise InputError(f"{where}: {format_validation_error(error, data)}") from error
    except InputError as error:
        raise InputError(f"{where}: {error}") from error


def format_validation_error(error: ValidationError, data: object) -> str:
    """Describe the first error in one sentence: its place in `data`, the value found there and the expectation."""
    problem = error.errors()[0]
    kind, loc = problem["type"], problem["loc"]
    field, owner = "", ""
    here: Any = data
    for part in loc:
        # Missing parts show which branch of a union was tried, unless the error is that they are missing or unknown.
        missing = isinstance(here, dict) and kind == "missing" and part == loc[-1]
        within = isinstance(here, list | tuple) and isinstance(part, int) and part < len(here)
        there = part in here if isinstance(here, dict) else within
        if there or missing:
            field += f"[{part}]" if isinstance(part, int) else f".{part}"
            here = here[part] if there else None
            if isinstance(part, int) and isinstance(here, dict) and "name" in here:
                owner = f" (object {here['name']!r})"
    field = field.lstrip(".")
    if kind == "extra_forbidden":
        return f"{field}{owner}: unknown key"
    if kind == "missing":
        return f"has no {field}{owner}"
    if kind == "union_tag_invalid":
        context = problem["ctx"]
        which, expected = context["discriminator"].strip("'"), context["expected_tags"].replace("'", "")
        return f"{field}.{which}{owner} is {context['tag']!r}, expected one of: {expected}".lstrip(".")
    message = problem["msg"].removeprefix("Value error, ")
    if not field:
        return message
    value = "" if isinstance(problem["input"], dict) else f" is {problem['input']!r}"
    return f"{field}{owner}{value}: {message[0].lower()}{message[1:]}"
