"""JSON Schema of documents, by which editors complete and check them.

Descriptions come from the docstrings of the models: that of a table from the text above the first section,
those of its fields from the section "Attributes".
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from typing import Any

from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import core_schema

from solver.scene import Model

_SECTION = re.compile(r"^(\w[\w ]*)\n-+\n", re.MULTILINE)
_FIELD = re.compile(r"^(\w[\w, ]*)(?: :.*)?\n((?: +.*\n?|\n)+)", re.MULTILINE)


def document_schema(model: type[Model]) -> dict[str, Any]:
    """Return the JSON Schema of the documents that a model describes.

    Parameters
    ----------
    model : type
        Such as `Study`.

    Returns
    -------
    dict
        In the dialect of 2020-12.
    """
    schema = model.model_json_schema(schema_generator=_DocumentedSchema)
    return {"$schema": GenerateJsonSchema.schema_dialect} | schema


class _DocumentedSchema(GenerateJsonSchema):
    """Takes descriptions from docstrings."""

    def model_schema(self, schema: core_schema.ModelSchema) -> JsonSchemaValue:
        described = super().model_schema(schema)
        model = schema["cls"]
        described["description"] = _sections(model)[""]
        fields = dict(_fields(model))
        for name, value in described.get("properties", {}).items():
            if name in fields:
                value["description"] = fields[name]
        return described


def _fields(model: type) -> Iterator[tuple[str, str]]:
    """Descriptions of a model's fields by name; its own come after those that it inherits."""
    for cls in reversed(model.__mro__):
        for names, text in _FIELD.findall(_sections(cls).get("Attributes", "")):
            for name in names.split(", "):
                yield name, _one_line(text)


def _sections(cls: type) -> dict[str, str]:
    """Split the docstring of a class at the headings of its sections; the text above them has the name ""."""
    text, *rest = _SECTION.split(inspect.cleandoc(cls.__doc__ or ""))
    return {"": _one_line(text)} | dict(zip(rest[::2], rest[1::2], strict=True))


def _one_line(text: str) -> str:
    return " ".join(text.split())
