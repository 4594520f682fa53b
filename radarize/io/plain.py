"""Plain data that is checked when it is made, and what is wrong with it as a sentence."""

from reprlib import repr as shortened
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

#: Of any number that somebody may set, in its unit.
MOST = 1_000_000


class Frozen(BaseModel):
    """Fields that nobody changes, and none that nobody knows."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


def setting(default: object, about: str, **limits: Any) -> Any:
    """A field that somebody may set: its default, what it means, with its unit, and limits as of pydantic's `Field`.

    Numbers without an upper limit of their own have `MOST`: what is computed from them stays finite.
    """
    if isinstance(default, int | float) and not isinstance(default, bool) and not limits.keys() & {"le", "lt"}:
        limits["le"] = MOST
    return Field(default, description=about, **limits)


def format_validation_error(error: ValidationError) -> str:
    """The first thing that is wrong: field, value, and what is expected."""
    first = error.errors()[0]
    field = ".".join(map(str, first["loc"])) or "file"
    if first["type"] == "missing":
        return f"has no {field}"
    return f"{field} is {shortened(first['input'])}, expected: {first['msg']}"
