"""Plain data classes with validation, and validation errors as sentences."""

from reprlib import repr as shortened
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

#: Upper limit of any numeric setting, in its unit.
MOST = 1_000_000


class Frozen(BaseModel):
    """Base class of immutable data that refuses unknown fields."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


def setting(default: object, about: str, **limits: Any) -> Any:
    """Return a field of a configuration: default, description with unit, and limits as in pydantic's `Field`.

    Numbers without an upper limit get `MOST`, so that values computed from them are finite.
    """
    if isinstance(default, int | float) and not isinstance(default, bool) and not limits.keys() & {"le", "lt"}:
        limits["le"] = MOST
    return Field(default, description=about, **limits)


def format_validation_error(error: ValidationError) -> str:
    """Return the first error as text: field, value, and what is expected."""
    first = error.errors()[0]
    field = ".".join(map(str, first["loc"])) or "file"
    if first["type"] == "missing":
        return f"has no {field}"
    return f"{field} is {shortened(first['input'])}, expected: {first['msg']}"
