"""Plain data that is checked when it is made, and what is wrong with it as a sentence."""

from reprlib import repr as shortened
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError


class Frozen(BaseModel):
    """Fields that nobody changes, and none that nobody knows."""

    model_config = ConfigDict(frozen=True, extra="forbid")


def setting(default: object, about: str, **limits: object) -> Any:
    """A field that somebody may set: its default, what it means, with its unit, and limits as of pydantic's `Field`."""
    return Field(default, description=about, **limits)


def complaint(error: ValidationError) -> str:
    """The first thing that is wrong: field, value, and what is expected."""
    first = error.errors()[0]
    return f"{'.'.join(map(str, first['loc'])) or 'file'} is {shortened(first['input'])}, expected: {first['msg']}"
