"""The description of the service in OpenAPI: what FastAPI finds out, and models that it is not told of."""

from __future__ import annotations

from typing import Any

from fastapi import FastAPI
from pydantic import BaseModel
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaMode, JsonSchemaValue
from pydantic_core.core_schema import FloatSchema

from api.http.problems import ProblemDocument
from api.http.schemas import Submission
from ensemble.store.run_record import RunSummary

PLACE = "#/components/schemas/{model}"
NON_FINITE = ["NaN", "Infinity", "-Infinity"]

# Problems and submissions are written and read without FastAPI; for a run, it knows of no number that is not
# finite, which a failed one may hold.
MODELS: tuple[tuple[type[BaseModel], JsonSchemaMode], ...] = (
    (ProblemDocument, "serialization"),
    (Submission, "validation"),
    (RunSummary, "serialization"),
)


class _WithNonFinite(GenerateJsonSchema):
    """Says of a number that is written as a string, where it is not finite, that it may be one."""

    def float_schema(self, schema: FloatSchema) -> JsonSchemaValue:
        """Describe a number."""
        described = super().float_schema(schema)
        if self.mode == "serialization" and self._config.ser_json_inf_nan == "strings":
            return {"anyOf": [described, {"enum": NON_FINITE}]}
        return described


def reference(model: type[BaseModel]) -> dict[str, Any]:
    """Refer to one of `MODELS`."""
    return {"$ref": PLACE.format(model=model.__name__)}


def complete(app: FastAPI) -> None:
    """Put the models into the description of an application that has all of its routes."""
    schemas = app.openapi()["components"]["schemas"]
    for model, mode in MODELS:
        schema = model.model_json_schema(mode=mode, schema_generator=_WithNonFinite, ref_template=PLACE)
        schemas |= schema.pop("$defs", {}) | {model.__name__: schema}
