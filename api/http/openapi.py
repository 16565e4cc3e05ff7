"""The OpenAPI description of the service, with the models that FastAPI does not add by itself."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from fastapi import FastAPI
from pydantic import BaseModel
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaMode, JsonSchemaValue
from pydantic_core.core_schema import FloatSchema

FIRST_SECTION = "\n\nParameters\n---"  # of a docstring in the numpydoc format
SCHEMA_REFERENCE = "#/components/schemas/{model}"
NON_FINITE = ["NaN", "Infinity", "-Infinity"]


class _NonFiniteSchema(GenerateJsonSchema):
    """Describes numbers that are serialized as strings where they are not finite."""

    def float_schema(self, schema: FloatSchema) -> JsonSchemaValue:
        """See `GenerateJsonSchema`."""
        described = super().float_schema(schema)
        if self.mode == "serialization" and self._config.ser_json_inf_nan == "strings":
            return {"anyOf": [described, {"enum": NON_FINITE}]}
        return described


def reference(model: type[BaseModel]) -> dict[str, Any]:
    """Return a JSON Schema reference to a model of the description.

    Parameters
    ----------
    model : type
        A pydantic model; `add_models` must put it into the description.

    Returns
    -------
    dict
    """
    return {"$ref": SCHEMA_REFERENCE.format(model=model.__name__)}


def add_models(app: FastAPI, models: Iterable[tuple[type[BaseModel], JsonSchemaMode]]) -> None:
    """Add models to the description of an application.

    Parameters
    ----------
    app : FastAPI
        An application that has all of its routes.
    models : iterable of (type, str)
        Models that FastAPI does not know because routes read or write them without its help, or that it
        describes incompletely.  Each with its mode: ``validation`` for input, ``serialization`` for output.
    """
    schemas = app.openapi()["components"]["schemas"]
    for model, mode in models:
        schema = model.model_json_schema(
            mode=mode, schema_generator=_NonFiniteSchema, ref_template=SCHEMA_REFERENCE
        )
        schemas |= schema.pop("$defs", {}) | {model.__name__: schema}


def shorten_descriptions(app: FastAPI) -> None:
    """Describe each route by its docstring, up to the first section.

    The sections are about the Python function. Parameters of the route have their own descriptions.

    Parameters
    ----------
    app : FastAPI
        An application that has all of its routes.
    """
    for operations in app.openapi()["paths"].values():
        for operation in operations.values():
            operation["description"] = operation["description"].partition(FIRST_SECTION)[0]
