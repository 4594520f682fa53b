"""JSON schemas of the models of YAML files: editors complete and check such files by them."""

import inspect
import re
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel, GetJsonSchemaHandler
from pydantic.json_schema import GenerateJsonSchema

_SECTION = re.compile(r"^(Args|Attributes|Returns|Raises|Example):\n", re.MULTILINE)
_ENTRY = re.compile(r"^    ([\w, .*]+): (.*(?:\n {8,}.*)*)", re.MULTILINE)


class Described(BaseModel):
    """Model whose JSON schema has the descriptions of fields in the docstring's section Attributes."""

    @classmethod
    def __get_pydantic_json_schema__(cls, core: Any, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        schema = handler(core)
        found = handler.resolve_ref_schema(schema)
        found["description"] = summary(cls)
        about = attributes(cls)
        for name, field in found.get("properties", {}).items():
            if name in about:
                field.setdefault("description", about[name])
        return schema


class _Generator(GenerateJsonSchema):
    def encode_default(self, dft: Any) -> Any:
        return float(dft) if isinstance(dft, float) else super().encode_default(dft)  # of numpy, too

    def field_title_should_be_set(self, schema: Any) -> bool:
        return False


def json_schema(model: type[BaseModel], title: str) -> dict[str, Any]:
    """Return the JSON schema of a model with a title."""
    found = model.model_json_schema(schema_generator=_Generator)
    return {"$schema": GenerateJsonSchema.schema_dialect, **found, "title": title}


def summary(model: type) -> str:
    """Return a class's docstring up to its first section, in one line."""
    return " ".join(sections(inspect.getdoc(model) or "")[0].split())


def attributes(model: type) -> dict[str, str]:
    """Return the descriptions in the sections Attributes of a class and of the classes that it inherits from."""
    found: dict[str, str] = {}
    for each in reversed(model.__mro__):
        if each.__module__.startswith("pydantic") or each is object or not each.__doc__:
            continue
        for name, body in sections(inspect.cleandoc(each.__doc__))[1]:
            if name == "Attributes":
                for names, about in entries(body):
                    found |= dict.fromkeys(names.split(", "), about.removesuffix("."))
    return found


def sections(docstring: str) -> tuple[str, list[tuple[str, str]]]:
    """Return the text before the first section of a docstring in Google's style, and name and body of each section."""
    about, *parts = _SECTION.split(docstring)
    return about, list(zip(parts[::2], parts[1::2], strict=True))


def entries(body: str) -> list[tuple[str, str]]:
    """Return names and description of each entry of a section such as Args, descriptions in one line."""
    return [(names, " ".join(about.split())) for names, about in _ENTRY.findall(body)]


def inline(model: type[Described], handler: GetJsonSchemaHandler) -> dict[str, Any]:
    """Return the JSON schema of a model within that of another field."""
    return dict(handler.resolve_ref_schema(model.__get_pydantic_json_schema__(model.__pydantic_core_schema__, handler)))


@dataclass(frozen=True)
class Changes:
    """Annotation of a field that takes some of a model's fields, or one of some names.

    Attributes:
        model: whose fields they are.
        names: that stand for all fields.
    """

    model: type[Described]
    names: tuple[str, ...] = ()

    def __get_pydantic_json_schema__(self, core: Any, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        fields = {key: value for key, value in inline(self.model, handler).items() if key != "required"}
        return {"anyOf": [{"enum": [*self.names]}, fields]} if self.names else {"allOf": [fields]}
