"""A registry makes a field one of several models, also of those that are added later."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Annotated, Any, Literal

import jsonschema_rs
import pytest
from pydantic import ValidationError

from solver.model import Model, Positive
from solver.registry import Registry


class Circle(Model):
    kind: Literal["circle"] = "circle"
    radius: Positive


class Square(Model):
    kind: Literal["square"] = "square"
    side: Positive
    corners: tuple[float, float] | None = None


class Dot(Model):
    """Has no field without a default, so a document that names no kind would fit it."""

    kind: Literal["dot"] = "dot"


SHAPES: Registry[Model] = Registry(default="circle")
KINDS: Registry[Model] = Registry()
for registry in (SHAPES, KINDS):
    registry.add(Circle)
    registry.add(Square)


class Figure(Model):
    shape: Annotated[Model, SHAPES]
    other: Annotated[Model, KINDS] | None = None


@pytest.fixture
def dots() -> Iterator[None]:
    """A model that is registered after the field that may hold it has been made, and removed again."""
    SHAPES.add(Dot)
    yield
    SHAPES.remove(Dot)


@pytest.mark.parametrize("read", [Figure.model_validate, lambda d: Figure.model_validate_json(json.dumps(d))])
def test_a_document_becomes_the_model_of_its_kind(read: Any) -> None:
    figure = read({"shape": {"kind": "square", "side": 2}, "other": {"kind": "circle", "radius": 1}})
    assert figure == Figure(shape=Square(side=2.0), other=Circle(radius=1.0))
    assert figure.model_dump() == {
        "shape": {"kind": "square", "side": 2.0, "corners": None},
        "other": {"kind": "circle", "radius": 1.0},
    }
    assert Figure.model_validate_json(figure.model_dump_json()) == figure


def test_a_document_without_a_kind_is_of_the_default_one() -> None:
    assert Figure.model_validate({"shape": {"radius": 1.0}}).shape == Circle(radius=1.0)


@pytest.mark.parametrize(
    ("other", "location", "message"),
    [
        ({"side": 1.0}, (), "Unable to extract tag using discriminator 'kind'"),
        ({"kind": "line"}, (), "'line' .* does not match any of the expected tags: 'circle', 'square'"),
        ({"kind": ["circle"]}, (), r"does not match any of the expected tags: 'circle', 'square'"),
        (5, (), "valid dictionary"),
        (Dot(), (), "valid dictionary"),
        ({"kind": "square"}, ("side",), "Field required"),
        ({"kind": "square", "side": -1.0}, ("side",), "greater than 0"),
        ({"kind": "square", "radius": 1.0, "side": 1.0}, ("radius",), "Extra inputs"),
    ],
)
def test_a_refusal_names_the_field_and_what_is_allowed(
    other: Any, location: tuple[str, ...], message: str
) -> None:
    with pytest.raises(ValidationError, match=message) as refused:
        Figure.model_validate({"shape": {"radius": 1.0}, "other": other})
    (error,) = refused.value.errors()
    assert error["loc"] == ("other", *location)


def test_strict_validation_of_json_converts_nothing() -> None:
    def read(document: str) -> Figure:
        return Figure.model_validate_json(document, strict=True)

    square = Square(side=2, corners=(1.0, 2.0))
    assert read('{"shape": {"kind": "square", "side": 2, "corners": [1, 2]}}') == Figure(shape=square)
    with pytest.raises(ValidationError, match=r"(?s)shape\.side.*valid number"):
        read('{"shape": {"kind": "square", "side": "2"}}')
    with pytest.raises(ValidationError, match=r"(?s)shape\.side.*valid number"):
        Figure.model_validate({"shape": {"kind": "square", "side": "2"}}, strict=True)
    with pytest.raises(ValidationError, match=r"(?s)shape\.side.*finite number"):
        read('{"shape": {"kind": "square", "side": NaN}}')


@pytest.mark.usefixtures("dots")
def test_a_model_that_is_added_later_is_known_everywhere() -> None:
    figure = Figure.model_validate({"shape": {"kind": "dot"}})
    assert figure.shape == Dot()
    assert figure.model_dump_json() == '{"shape":{"kind":"dot"},"other":null}'
    assert "Dot" in Figure.model_json_schema()["$defs"]
    assert list(SHAPES) == [Circle, Square, Dot]


def test_a_model_that_is_removed_is_unknown() -> None:
    SHAPES.add(Dot)
    SHAPES.remove(Dot)
    with pytest.raises(ValidationError, match="'dot'"):
        Figure.model_validate({"shape": {"kind": "dot"}})
    assert "Dot" not in Figure.model_json_schema()["$defs"]


def test_two_models_of_one_kind_are_refused() -> None:
    class Round(Model):
        kind: Literal["circle"] = "circle"

    SHAPES.add(Circle)  # once more
    with pytest.raises(ValueError, match="'circle' is registered already, as Circle"):
        SHAPES.add(Round)


@pytest.mark.usefixtures("dots")
@pytest.mark.parametrize(
    "document",
    [
        {"shape": {"radius": 1.0}},
        {"shape": {"kind": "circle", "radius": 1.0}, "other": {"kind": "square", "side": 1.0}},
        {"shape": {"kind": "dot"}},
        {"shape": {"kind": "dot", "radius": 1.0}},
        {"shape": {}},
        {"shape": {"side": 1.0}},
        {"shape": {"radius": 1.0}, "other": {"radius": 1.0}},
        {"shape": {"radius": 1.0}, "other": {"kind": "dot"}},
    ],
    ids=str,
)
def test_the_json_schema_accepts_what_the_model_does(document: dict[str, Any]) -> None:
    try:
        Figure.model_validate(document)
        accepted = True
    except ValidationError:
        accepted = False
    assert jsonschema_rs.is_valid(Figure.model_json_schema(), document) is accepted
