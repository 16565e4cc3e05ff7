"""What may be added to a scene from outside: models told apart by their ``kind``, and names.

A `Registry` of models is the annotation of such a field::

    FLOWS: Registry[ImposedFlow] = Registry()
    FLOWS.add(Shear)

    class Scene(Model):
        flow: Annotated[ImposedFlow, FLOWS] | None = None

Documents, errors and JSON schemas are those of pydantic's discriminated union of the registered models.
Unlike that union, a registry is looked up whenever a document is validated, so that a model may be added
after the classes with such a field have been made.  `RegisteredNames` are the same for a field that is one of
several strings, instead of a ``Literal``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Generic, TypeGuard, TypeVar

from pydantic import BaseModel, GetCoreSchemaHandler, GetJsonSchemaHandler, ValidationInfo
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticKnownError, core_schema, to_json

M = TypeVar("M", bound=BaseModel)

_DISCRIMINATOR = "kind"


class Registry(Generic[M]):
    """Models told apart by their field ``kind``, a string literal with itself as the default.

    Parameters
    ----------
    default : str, optional
        The kind of a document that names none.  Without it such a document is refused.
    """

    def __init__(self, default: str | None = None) -> None:
        self._default = default
        self._models: dict[str, type[M]] = {}

    def add(self, model: type[M]) -> None:
        """Register a model.

        Parameters
        ----------
        model : type
            Pydantic model with a field such as ``kind: Literal["shear"] = "shear"``.

        Raises
        ------
        ValueError
            If another model of this kind is registered already.
        """
        kind = _kind_of(model)
        if self._models.setdefault(kind, model) is not model:
            raise ValueError(f"kind {kind!r} is registered already, as {self._models[kind].__name__}")

    def remove(self, model: type[M]) -> None:
        """Undo `add`.

        Parameters
        ----------
        model : type
            A registered model.
        """
        del self._models[_kind_of(model)]

    def __iter__(self) -> Iterator[type[M]]:
        """Iterate over the registered models in the order of their registration."""
        return iter(tuple(self._models.values()))

    def _validate(self, value: Any, info: ValidationInfo) -> M:
        """Make a model from a document; an instance of a registered model stays as it is."""
        if self._holds(value):
            return value
        # Pydantic merges the errors of the model into those of the document around it.
        return self._model_for(value).model_validate(value, context=info.context)

    def _validate_strictly(self, value: Any, info: ValidationInfo) -> M:
        """Do as `_validate`, with no conversion between types but those from JSON."""
        if self._holds(value):
            return value
        model = self._model_for(value)
        if info.mode == "json":
            text = to_json(value, inf_nan_mode="constants")
            return model.model_validate_json(text, strict=True, context=info.context)
        return model.model_validate(value, strict=True, context=info.context)

    def _holds(self, value: Any) -> TypeGuard[M]:
        return isinstance(value, tuple(self._models.values()))

    def _model_for(self, value: Any) -> type[M]:
        """Return the model of the kind that a document names."""
        if not isinstance(value, Mapping):
            raise PydanticKnownError("dict_type")
        if _DISCRIMINATOR not in value and self._default is None:
            raise PydanticKnownError("union_tag_not_found", {"discriminator": repr(_DISCRIMINATOR)})
        kind = value.get(_DISCRIMINATOR, self._default)
        # A list has no hash, so it cannot be looked up.
        if not isinstance(kind, str) or kind not in self._models:
            context = {
                "discriminator": repr(_DISCRIMINATOR),
                "tag": str(kind),
                "expected_tags": ", ".join(map(repr, self._models)),
            }
            raise PydanticKnownError("union_tag_invalid", context)
        return self._models[kind]

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Validate by looking the kind up; serialize as the model that a value is."""
        return core_schema.lax_or_strict_schema(
            core_schema.with_info_plain_validator_function(self._validate),
            core_schema.with_info_plain_validator_function(self._validate_strictly),
        )

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """Describe the union of the models registered now."""
        models: dict[Any, CoreSchema] = {
            kind: model.__pydantic_core_schema__ for kind, model in self._models.items()
        }
        described = handler(core_schema.tagged_union_schema(models, _DISCRIMINATOR))
        # A model's own schema does not require `kind`, which has a default.  Exactly one of them must match.
        for kind, alternative in zip(self._models, described["oneOf"], strict=True):
            if kind != self._default:
                alternative["required"] = [_DISCRIMINATOR]
        return described


def _kind_of(model: type[BaseModel]) -> str:
    kind: str = model.model_fields[_DISCRIMINATOR].default
    return kind


class RegisteredNames:
    """Strings that a field may be.

    Parameters
    ----------
    *names : str
        To begin with.
    """

    def __init__(self, *names: str) -> None:
        self._names = list(names)

    def add(self, name: str) -> None:
        """Register a name.

        Parameters
        ----------
        name : str

        Raises
        ------
        ValueError
            If it is registered already.
        """
        if name in self._names:
            raise ValueError(f"the name {name!r} is registered already")
        self._names.append(name)

    def remove(self, name: str) -> None:
        """Undo `add`.

        Parameters
        ----------
        name : str
            A registered name.
        """
        self._names.remove(name)

    def __iter__(self) -> Iterator[str]:
        """Iterate over the registered names in the order of their registration."""
        return iter(tuple(self._names))

    def _validate(self, value: Any) -> str:
        if isinstance(value, str) and value in self._names:
            return value
        *others, last = map(repr, self._names)
        expected = f"{', '.join(others)} or {last}" if others else last
        raise PydanticKnownError("literal_error", {"expected": expected})

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Validate by looking the name up."""
        return core_schema.no_info_plain_validator_function(self._validate)

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """Describe the names registered now."""
        return {"type": "string", "enum": list(self._names)}
