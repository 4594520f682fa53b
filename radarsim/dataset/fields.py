"""JSON schemas of fields of a data set's specification that other models describe."""

from dataclasses import dataclass
from typing import Any

from pydantic import GetJsonSchemaHandler
from pydantic_core import CoreSchema

from radarsim.world.description import description_model
from radarsim.world.generators.buildings import Building, Office

#: Fields of a building in a specification that are beside `building` in a scene file.
OF_SCENE = "clutter", "unevenness", "furniture", "materials", "interferers"


@dataclass(frozen=True)
class Place:
    """A scene, or a generated building with fields of its scene file."""

    def __get_pydantic_json_schema__(self, core: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        def fields(model: Any) -> dict[str, Any]:
            return dict(handler.resolve_ref_schema(handler(model.__pydantic_core_schema__)))

        scene = fields(description_model())["properties"]
        seeds = {
            "description": "first and last seed of several buildings, which are called NAME and the seed",
            "type": "array", "items": {"type": "integer", "minimum": 0}, "minItems": 2, "maxItems": 2,
        }  # fmt: skip
        own = {name: scene[name] for name in OF_SCENE} | {"seeds": seeds}
        kinds = [
            each | {"properties": each["properties"] | own, "required": ["kind"]}
            for each in map(fields, (Building, Office))
        ]
        return {"anyOf": [{"type": "string"}, *kinds]}


@dataclass(frozen=True)
class SensorName:
    """A name of `radarsim.sensors.suite.SENSORS`, or all."""

    def __get_pydantic_json_schema__(self, core: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        from radarsim.sensors.suite import SENSORS

        return {"enum": ["all", *SENSORS]}
