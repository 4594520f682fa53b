"""Where odometry of a run saw nothing, as the run tells itself."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, Field, ValidationError

from radarize.errors import InputError

Amount = Annotated[float, Field(ge=0, allow_inf_nan=False)]


class Span(BaseModel):
    """From when to when, s since the first frame; the way meanwhile, m; why."""

    start_s: Amount
    stop_s: Amount
    way_m: Amount
    why: str


class Blindness(BaseModel):
    """The spans together: way, m, and its share of the whole way."""

    share_of_way: Amount
    way_m: Amount
    spans: list[Span]

    @classmethod
    def of(cls, facts: Mapping[str, object], path: Path) -> "Blindness | None":
        """What ``run.json`` says; None where it does not, as runs of old.

        Raises:
            InputError: it says something else.
        """
        if "blind" not in facts:
            return None
        try:
            return cls.model_validate(facts["blind"])
        except ValidationError as error:
            problem = error.errors()[0]
            field = ".".join(map(str, ("blind", *problem["loc"])))
            raise InputError(f"{path}: {field} is {str(problem['input'])[:60]!r}: {problem['msg'].lower()}") from error
