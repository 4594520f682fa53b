"""JSON schemas of fields of a data set's specification that other models describe."""

from dataclasses import dataclass
from typing import Any

from pydantic import GetJsonSchemaHandler

from radarize.io.schema import inline
from radarsim.world.description import description_model
from radarsim.world.generators.buildings import Building, Office

#: Fields of a building in a specification that are beside `building` in a scene file.
OF_SCENE = "clutter", "unevenness", "furniture", "materials", "interferers"


@dataclass(frozen=True)
class Place:
    """A scene, or a generated building with fields of its scene file."""

    def __get_pydantic_json_schema__(self, core: Any, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        scene = inline(description_model(), handler)["properties"]
        seeds = {
            "description": "first and last seed of several buildings, which are called NAME and the seed",
            "type": "array", "items": {"type": "integer", "minimum": 0}, "minItems": 2, "maxItems": 2,
        }  # fmt: skip
        own = {name: scene[name] for name in OF_SCENE} | {"seeds": seeds}
        kinds = [
            each | {"properties": each["properties"] | own, "required": ["kind"]}
            for each in (inline(Building, handler), inline(Office, handler))
        ]
        return {"anyOf": [{"type": "string"}, *kinds]}


@dataclass(frozen=True)
class SensorName:
    """A name of `radarsim.sensors.suite.SENSORS`, or all."""

    def __get_pydantic_json_schema__(self, core: Any, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        from radarsim.sensors.suite import SENSORS

        return {"enum": ["all", *SENSORS]}
