"""Field types of scene files."""

from typing import Annotated

from pydantic import ConfigDict, Field

from radarize.io.schema import Described

Number = Annotated[float, Field(allow_inf_nan=False)]
Length = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Name = Annotated[str, Field(min_length=1)]
Vector = tuple[Number, Number, Number]


class Strict(Described):
    """Fields that do not change, and no others."""

    model_config = ConfigDict(extra="forbid", frozen=True)
