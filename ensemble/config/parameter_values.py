"""Values of the parameters that a document varies: they have these ones' dimensions, and may have units."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, get_args

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler, ValidationInfo
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, core_schema

from ensemble.config.dotted_paths import Location, is_array, locations, value_at
from ensemble.config.measured import dimension_at
from solver.dimensions import Dimension, or_quantity
from solver.scene import Scene

# How pydantic tells an element from an array of it.
ONE: Final = "one"
SEVERAL: Final = "several"

_SCENE: Final = "scene"  # key of the validated scene in the context of a validation


def remember_scene(scene: Scene, info: ValidationInfo) -> Scene:
    """Keep the scene of a document for the parameters that are validated after it.

    Parameters
    ----------
    scene : Scene
    info : ValidationInfo
        Of pydantic.

    Returns
    -------
    Scene
        The same.
    """
    if info.context is not None:
        info.context[_SCENE] = scene
    return scene


@dataclass(frozen=True)
class ValueOf:
    """Metadata of a value of a parameter, which has that one's dimension.

    Attributes
    ----------
    role : str
        Key, in the context of a validation, of the dimensions of the parameters that have this role.
    """

    role: str

    def remember(self, path: str, info: ValidationInfo) -> str:
        """Keep the dimension of a parameter for the values that are validated after it.

        Parameters
        ----------
        path : str
            Dotted path of the parameter.
        info : ValidationInfo
            Of pydantic.

        Returns
        -------
        str
            The path.
        """
        if info.context is not None and _SCENE in info.context:
            info.context.setdefault(self.role, []).append(dimension_at(info.context[_SCENE], path))
        return path

    def _validate(self, value: Any, handler: Callable[[Any], Any], info: ValidationInfo) -> Any:
        dimensions: list[Dimension | None] = (info.context or {}).get(self.role, [])
        # The values of a parameter follow it.  A place has one value for each parameter, in their order.
        if is_array(value):
            padded = [*dimensions, *[None] * len(value)]
            return handler(tuple(_number(each, padded[index], info) for index, each in enumerate(value)))
        return handler(_number(value, dimensions[-1] if dimensions else None, info))

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Convert text with a unit before the field's own checks."""
        return core_schema.with_info_wrap_validator_function(self._validate, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """Describe the number, or the text of one with a unit."""
        return or_quantity(handler(schema), handler.mode)


def _number(value: Any, dimension: Dimension | None, info: ValidationInfo) -> Any:
    return value if dimension is None else dimension.validate(value, lambda number: number, info)


class OneOrSeveral:
    """Metadata of a tuple that documents write as its element if it has only one."""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Take an element for a tuple of it, and write it so."""
        several = handler(source)
        one = handler.generate_schema(get_args(source)[0])
        # Not a function before the tuple, which would see parsed JSON and lose its strict types.
        return core_schema.tagged_union_schema(
            {ONE: core_schema.no_info_after_validator_function(_alone, one), SEVERAL: several},
            lambda given: SEVERAL if is_array(given) else ONE,
            serialization=core_schema.wrap_serializer_function_ser_schema(_written, schema=several),
        )

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """Describe the element or the array."""
        return {"anyOf": handler(schema)["oneOf"]}


def _alone(element: Any) -> tuple[Any]:
    return (element,)


def _written(elements: Any, handler: Callable[[Any], Any]) -> Any:
    written = handler(elements)
    return written[0] if len(written) == 1 else written


def number_locations(document: dict[str, Any], field: str, path: str) -> set[Location]:
    """Return the places of a scene that a parameter names, all of which must hold numbers.

    Parameters
    ----------
    document : dict
        Of the scene.
    field : str
        That names the parameter, for messages: such as ``search.parameter``.
    path : str
        Dotted path of the parameter.

    Returns
    -------
    set of tuple

    Raises
    ------
    ValueError
        If the scene has no number there; names the field.
    """
    try:
        places = set(locations(document, path))
    except ValueError as error:
        raise ValueError(f"{field}: {error}") from None
    numbers = [value_at(document, location) for location in places]
    if not numbers or not all(type(number) in (int, float) for number in numbers):
        raise ValueError(f"{field}: {path!r} — must be the dotted path of a number in the scene")
    return places
