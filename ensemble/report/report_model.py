"""What reports are made of: immutable models that are strictly valid JSON, so without NaN or infinity."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class Document(BaseModel):
    """Base of everything in a report."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
