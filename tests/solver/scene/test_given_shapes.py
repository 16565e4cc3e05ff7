"""Vesicles with a shape of their own: what is accepted, what overlaps, and what stays as it was."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pydantic import ValidationError

from solver.membrane import curve
from solver.membrane.shapes import ellipse_tangent_angle
from solver.membrane.symmetry import has_images
from solver.scene import Scene, Start, Vesicle
from solver.scene.outlines import outline
from solver.scene.tangent_angles import closed_of_reduced_area, reduced_area_of

ALONG = 2 * np.pi * np.arange(64) / 64
BEAN = closed_of_reduced_area(ALONG + 0.7 * np.sin(2 * ALONG) + 0.3 * np.cos(3 * ALONG), 0.65)


def bean(**fields: object) -> Vesicle:
    area, _ = reduced_area_of(BEAN)
    return Vesicle.model_validate(
        {"reduced_area": area, "tangent_angle": tuple(BEAN.tolist()), "angle": 0.0} | fields
    )


def test_area_and_gap_are_those_of_the_curve() -> None:
    points = curve.positions(BEAN, np.zeros(2), 2 * np.pi)
    area, gap = reduced_area_of(BEAN)
    assert area == pytest.approx(
        float(curve.area(points, curve.tangents(BEAN), 2 * np.pi)) / np.pi, rel=1e-12
    )
    assert gap == pytest.approx(float(curve.closure(curve.tangents(BEAN))), abs=1e-14)


def test_an_outline_is_where_the_membrane_is() -> None:
    vesicle = bean(center=(1.0, 2.0), angle=0.7, length=5.0)
    x, y = curve.positions(BEAN + 0.7, np.array([1.0, 2.0]), 5.0)
    np.testing.assert_allclose(outline(vesicle), x + 1j * y, atol=1e-12)


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        (np.linspace(0, 6, 17), "even number of angles, got 17"),
        (np.linspace(0, 6, 8), "at least 16"),
        (-2 * np.pi * np.arange(32) / 32, "counterclockwise"),
        (np.linspace(0, 3, 32), "closed curve"),
        (2 * np.pi * np.arange(32) / 32, "reduced area 1, and reduced_area is 0.9"),
    ],
)
def test_bad_shapes_are_refused_by_name(shape: np.ndarray, message: str) -> None:
    with pytest.raises(ValidationError, match=f"(?s)tangent_angle.*{message}"):
        Vesicle(tangent_angle=tuple(shape.tolist()))


def test_angles_that_jump_are_refused_instead_of_guessed() -> None:
    """They describe the same curve, but cannot be interpolated."""
    area, _ = reduced_area_of(BEAN)
    wrapped = np.angle(np.exp(1j * BEAN))
    for shape in (wrapped, np.roll(BEAN, 5)):
        with pytest.raises(
            ValidationError, match=r"(?s)tangent_angle.*less than π .* got 6\.\d+ after angle \d"
        ):
            Vesicle.model_validate({"reduced_area": area, "tangent_angle": tuple(shape.tolist())})
    turned = np.unwrap(np.roll(wrapped, 5))
    Vesicle.model_validate({"reduced_area": area, "tangent_angle": tuple(turned.tolist())})


@pytest.mark.parametrize("count", [32, 64, 512])
def test_a_shape_may_not_cross_itself(count: int) -> None:
    """Walls of this family meet at a = 1.1711, where ∫ cos(t + a sin 2t) dt from −π/2 to π/2 is 0."""
    along = 2 * np.pi * np.arange(count) / count
    for size, crosses in ((1.16, False), (1.18, True), (1.5, True)):
        shape = along + np.pi / 2 + size * np.sin(2 * along)
        area, _ = reduced_area_of(shape)
        fields = {"reduced_area": area, "tangent_angle": tuple(shape.tolist())}
        if crosses:
            with pytest.raises(ValidationError, match=r"(?s)tangent_angle.*does not cross itself"):
                Vesicle.model_validate(fields)
        else:
            Vesicle.model_validate(fields)


def test_shapes_overlap_where_their_outlines_do() -> None:
    """The bent one leaves room where an ellipse of its size would have none."""
    hollow, small = bean(), {"length": 0.5, "reduced_area": 0.99}
    inside = outline(hollow)
    far = {"center": (5.0, 0.0)}
    for center, overlap in (((0.0, 0.0), True), ((float(inside.real.max()) + 0.2, 0.0), False)):
        vesicles = [hollow, small | {"center": center}, small | far]
        if overlap:
            with pytest.raises(ValidationError, match="vesicles 0 and 1 overlap"):
                Scene.model_validate({"horizon": 1.0, "vesicles": vesicles})
        else:
            assert len(Scene.model_validate({"horizon": 1.0, "vesicles": vesicles}).vesicles) == 3


def test_a_pair_of_shapes_is_one_and_its_image_after_half_a_turn() -> None:
    first = bean(center=(-2.0, 0.0))
    second = bean(center=(2.0, 0.0), angle=math.pi)
    turned = bean(center=(2.0, 0.0), angle=0.0)
    assert has_images(Scene(horizon=1.0, vesicles=(first, second)))
    assert not has_images(Scene(horizon=1.0, vesicles=(first, turned)))
    shape = tuple((ellipse_tangent_angle(first.reduced_area, 1.0, 0.0, 64)).tolist())
    other = second.model_copy(update={"tangent_angle": shape})
    assert not has_images(Scene(horizon=1.0, vesicles=(first, other)))


def test_scenes_without_shapes_are_written_as_before_there_were_any() -> None:
    scene = Scene(horizon=1.0, vesicles=(Vesicle(),))
    assert "tangent_angle" not in scene.model_dump()["vesicles"][0]
    assert set(scene.model_dump()["start"]) == {"relaxed", "horizon", "tilt"}
    shaped = Scene(horizon=1.0, vesicles=(bean(),))
    assert Scene.model_validate_json(shaped.model_dump_json(), strict=True) == shaped


def test_a_deformation_takes_no_more_area_than_there_is() -> None:
    document = {"horizon": 1.0, "vesicles": [{"reduced_area": 0.98}]}
    Scene.model_validate(document | {"start": {"deformation": {"amplitude": 0.05}}})
    with pytest.raises(ValidationError, match=r"amplitude must be at most 0.0866.* got 0.1"):
        Scene.model_validate(document | {"start": {"deformation": {"amplitude": 0.1}}})
    with pytest.raises(ValidationError, match="leave one of the two out"):
        Start.model_validate({"relaxed": True, "deformation": {"amplitude": 0.1}})


@pytest.mark.parametrize("area", [1.0, 1 - 1e-12])
def test_a_circle_cannot_be_deformed(area: float) -> None:
    vesicles = [{"reduced_area": 0.9}, {"reduced_area": area, "center": (4.0, 0.0)}]
    with pytest.raises(ValidationError, match=r"start\.deformation: vesicle 1 is a circle"):
        Scene.model_validate(
            {"horizon": 1.0, "vesicles": vesicles, "start": {"deformation": {"amplitude": 1e-9}}}
        )
