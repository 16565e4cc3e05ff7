"""What all configuration has in common."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, get_args

from pydantic import BaseModel, ConfigDict, Field, model_validator

Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]


class Model(BaseModel):
    """Base of all configuration: immutable, refuses unknown keys, NaN and infinity, and true for 1."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _true_is_no_number(cls, data: Any) -> Any:
        for name, value in data.items() if isinstance(data, Mapping) else ():
            field, given = cls.model_fields.get(name), value if isinstance(value, list | tuple) else [value]
            is_truth = any(isinstance(each, bool) for each in given)
            if field is not None and is_truth and not _may_be_true(field.annotation):
                raise ValueError(f"{name} should not be true or false")
        return data


def _may_be_true(annotation: Any) -> bool:
    return annotation is bool or any(map(_may_be_true, get_args(annotation)))
