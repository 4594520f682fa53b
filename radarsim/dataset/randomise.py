"""``randomise`` draws values per recording. The default, ``randomise.yaml``, is the range of real rooms.

    randomise:
      clutter: {uniform: [0.7, 1.4]}                  # low, high
      furniture: {choice: [0.7, 1, 1.3]}              # one of these
      pitch: {normal: [5, 3]}                         # mean, standard deviation
      conductivity: {lognormal: [1, 0.4]}             # median, standard deviation of the logarithm
      height: {handheld: {uniform: [1.0, 1.4]}, cart: 0.95}                # by platform; a number is a constant

Fields that are not named are not drawn: ``randomise: {}`` draws nothing. Normal distributions are truncated at three
standard deviations. Fields that a building of the data set sets (``clutter: 0``) or that a variant's mounting sets are
not drawn. A value depends on the recording's seed and on the field only; variants of a recording share it.
"""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal

import numpy as np
from pydantic import ValidationInfo, field_serializer, field_validator
from scipy.special import ndtr, ndtri

from radarize.io.plain import MOST, Frozen
from radarize.io.yamlfile import read_beside
from radarsim.machine.rng import keyed_rng
from radarsim.motion.platforms import PLATFORMS
from radarsim.motion.trajectory import Mounting
from radarsim.world.materials import DIELECTRICS

Platform = Literal["handheld", "cart", "robot"]
#: Lowest and highest value that a field may get.
LIMITS = {
    "clutter": (0.0, 10.0), "unevenness": (0.0, 10.0), "furniture": (0.0, 2.0), "permittivity": (0.5, 2.0),
    "conductivity": (0.1, 10.0), "height": (0.05, 2.5), "pitch": (-45.0, 45.0), "roll": (-45.0, 45.0),
}  # fmt: skip
#: Fields that set the sensor's pose on its platform.
OF_SENSOR = "height", "pitch", "roll"
#: Parameters of each distribution.
_NUMBERS = {
    "uniform": "[low, high]",
    "normal": "[mean, standard deviation]",
    "lognormal": "[median, standard deviation of the logarithm]",
    "choice": "[value, ...]",
}
_KINDS = "; ".join(f"{kind}: {numbers}" for kind, numbers in _NUMBERS.items())
_EXPECTED = f"expected a number or one of: {_KINDS}; or such for some of {', '.join(PLATFORMS)}"
#: Largest standard deviations allowed.
_WIDEST = {"normal": 100.0, "lognormal": 3.0}
#: Standard deviations at which normal distributions are truncated, and the probability below.
_END = 3.0
_BELOW = [float(share) for share in ndtr([-_END, _END])]
#: Materials whose permittivity is drawn; people's skin is not among a room's materials.
_SCALED = [name for name in DIELECTRICS if name != "skin"]


@dataclass(frozen=True)
class Distribution:
    """Probability distribution of a number.

    Attributes:
        kind: ``uniform``, ``normal``, ``lognormal``, ``choice`` or ``constant``.
        numbers: as in the file.
    """

    kind: str
    numbers: tuple[float, ...]

    @classmethod
    def of(cls, given: object) -> "Distribution":
        """Read a distribution from its YAML value.

        Raises:
            ValueError: the value is no distribution.
        """
        if _is_number(given):
            return cls("constant", (float(given),))  # type: ignore[arg-type]
        if not isinstance(given, Mapping):
            raise ValueError(_EXPECTED)
        if len(given) != 1 or not given.keys() <= _NUMBERS.keys():
            raise ValueError(f"has {', '.join(map(str, given)) or 'nothing'}, {_EXPECTED}")
        ((kind, numbers),) = given.items()
        wrong = ValueError(f"{kind} is {numbers!r}, expected {_NUMBERS[kind]}")
        if not (isinstance(numbers, list | tuple) and numbers and all(map(_is_number, numbers))):
            raise wrong
        if kind != "choice":
            if len(numbers) != 2:
                raise wrong
            if kind == "uniform" and numbers[0] > numbers[1]:
                raise ValueError(f"{kind} is {numbers!r}, expected the lower number first")
            if kind != "uniform" and not 0 <= numbers[1] <= _WIDEST[kind]:
                raise ValueError(f"{kind} is {numbers!r}, expected a standard deviation of 0 to {_WIDEST[kind]:g}")
            if kind == "lognormal" and numbers[0] <= 0:
                raise ValueError(f"{kind} is {numbers!r}, expected a median above 0")
        return cls(str(kind), tuple(map(float, numbers)))

    @property
    def given(self) -> float | dict[str, list[float]]:
        """YAML value of the distribution."""
        return self.numbers[0] if self.kind == "constant" else {self.kind: [*self.numbers]}

    def quantile(self, share: float) -> float:
        """Quantile of a probability 0...1."""
        if self.kind in ("constant", "choice"):
            return sorted(self.numbers)[min(int(share * len(self.numbers)), len(self.numbers) - 1)]
        first, last = self.numbers
        if self.kind == "uniform":
            return first + share * (last - first)
        low, high = _BELOW
        deviations = min(max(float(ndtri(low + share * (high - low))), -_END), _END)
        return first + last * deviations if self.kind == "normal" else first * float(np.exp(last * deviations))

    @classmethod
    def __get_pydantic_json_schema__(cls, core: object, handler: object) -> dict[str, Any]:
        number = {"type": "number"}
        two = {"type": "array", "items": number, "minItems": 2, "maxItems": 2}
        lists = {kind: two for kind in _NUMBERS} | {"choice": {"type": "array", "items": number, "minItems": 1}}
        named = [
            {
                "type": "object", "properties": {kind: numbers | {"description": _NUMBERS[kind]}},
                "required": [kind], "additionalProperties": False,
            }
            for kind, numbers in lists.items()
        ]  # fmt: skip
        return {"description": f"A number, which is a constant, or one of {_KINDS}.", "anyOf": [number, *named]}

    def __str__(self) -> str:
        numbers = ", ".join(f"{number:g}" for number in self.numbers)
        return numbers if self.kind == "constant" else f"{self.kind} {numbers}"


Drawn = Distribution | dict[Platform, Distribution] | None


class Randomise(Frozen):
    """Distributions by field; None: the field is not drawn.

    Attributes:
        clutter, unevenness: value in place of that of the scene file.
        furniture: number of pieces of furniture in a building, as a fraction of the usual number.
        permittivity, conductivity: factor on that of a material, drawn for each material.
        height: height of the sensor above the floor, m.
        pitch: pitch of the sensor on its platform, positive nose down, degrees.
        roll: roll of the sensor on its platform, degrees.
    """

    clutter: Drawn = None
    unevenness: Drawn = None
    furniture: Drawn = None
    permittivity: Drawn = None
    conductivity: Drawn = None
    height: Drawn = None
    pitch: Drawn = None
    roll: Drawn = None

    @classmethod
    @cache
    def usual(cls) -> "Randomise":
        """Default distributions, the range of real rooms."""
        return cls.model_validate(read_beside(__file__))

    @field_validator("*", mode="before")
    @classmethod
    def _read(cls, given: object, info: ValidationInfo) -> object:
        if given is None:
            return None
        field = str(info.field_name)
        if isinstance(given, Mapping) and given and given.keys() <= PLATFORMS.keys():
            found = {}
            for platform, each in given.items():
                try:
                    found[platform] = _within(Distribution.of(each), field)
                except ValueError as error:
                    raise ValueError(f"of {platform} is {each!r}: {error}") from error
            return found
        return _within(Distribution.of(given), field)

    @field_serializer("*")
    def _given(self, about: Drawn) -> object:
        return {key: each.given for key, each in about.items()} if isinstance(about, dict) else about and about.given

    def of(self, field: str, platform: str) -> Distribution | None:
        """Return the distribution of a field for a platform, or None."""
        about = getattr(self, field)
        return about.get(platform) if isinstance(about, dict) else about

    def draw(self, seed: int, platform: str, fixed: Collection[str] = ()) -> dict[str, Any]:
        """Draw the values of one recording, JSON-ready, rounded to four digits.

        Args:
            seed: of the recording.
            platform: of the recording.
            fixed: fields that are not drawn, and ``materials``.

        Returns:
            Fields of a scene file (clutter, unevenness, furniture, materials), and height, pitch and roll: all three if
                one of them is drawn, the others with the platform's values.
        """

        def drawn(field: str, about: Distribution, count: int = 1) -> list[float]:
            shares = keyed_rng(seed, f"randomise {field}").random(count)
            return [float(f"{about.quantile(share):.4g}") for share in shares]

        def wanted(*fields: str) -> dict[str, Distribution]:
            named = {field: self.of(field, platform) for field in fields if field not in fixed}
            return {field: about for field, about in named.items() if about is not None}

        found: dict[str, Any] = {}
        for field, about in wanted("clutter", "unevenness", "furniture").items():
            (found[field],) = drawn(field, about)
        if "materials" not in fixed and (factors := wanted("permittivity", "conductivity")):
            columns = [drawn(field, about, len(_SCALED)) for field, about in factors.items()]
            by = [dict(zip(factors, row, strict=True)) for row in zip(*columns, strict=True)]
            found["materials"] = dict(zip(_SCALED, by, strict=True))
        if placed := wanted(*OF_SENSOR):
            carrier = PLATFORMS[platform]
            tilt = Distribution("normal", (0.0, float(np.rad2deg(carrier.tilt))))
            own = {"height": Distribution("constant", (carrier.height,)), "pitch": tilt, "roll": tilt}
            for field, about in (own | placed).items():
                (found[field],) = drawn(field, about)
        return found

    def rows(self) -> Iterator[tuple[str, str, str]]:
        """Field, platform (``all``) and distribution of every field that is drawn."""
        for field in LIMITS:
            about = getattr(self, field)
            for platform, each in (about if isinstance(about, dict) else {"all": about}).items():
                if each is not None:
                    yield field, platform, str(each)


def mounting(drawn: Mapping[str, Any], platform: str) -> Mounting | None:
    """Return the mounting of a sensor with drawn height, pitch and roll; None: the platform's own."""
    if not drawn.keys() >= set(OF_SENSOR):
        return None
    carrier = PLATFORMS[platform]
    place = carrier.lever_arm, 0.0, drawn["height"] - carrier.height
    return Mounting.of(place, (drawn["roll"], drawn["pitch"], 0.0))


def _is_number(given: object) -> bool:
    return isinstance(given, int | float) and not isinstance(given, bool) and -MOST <= given <= MOST


def _within(about: Distribution, field: str) -> Distribution:
    """Check that all values of a distribution are allowed for its field; ValueError otherwise."""
    low, high = LIMITS[field]
    for value in (about.quantile(0.0), about.quantile(1.0)):
        if not low <= value <= high:
            reached = "" if about.kind == "constant" else f"{about} reaches {value:g}, "
            raise ValueError(f"{reached}expected {low:g} to {high:g}")
    return about
