"""Files with points along an outline: what is refused, and that the message names the file."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

from ensemble.config.outline_files import traced_in

ANGLE = 2 * np.pi * np.arange(80) / 80
ELLIPSE = np.column_stack([2 * np.cos(ANGLE), np.sin(ANGLE)])


def crossing() -> np.ndarray:
    """A dumbbell whose neck is turned inside out."""
    return np.column_stack([2 * np.cos(ANGLE), np.sin(ANGLE) * (1.3 * np.cos(ANGLE) ** 2 - 0.1)])


@pytest.mark.parametrize(
    ("points", "type_"),
    [
        (ELLIPSE * (1 + 1j), "complex128"),
        (np.round(1000 * ELLIPSE).astype("datetime64[s]"), r"datetime64\[s\]"),
        (ELLIPSE > 0, "bool"),
        (ELLIPSE.astype("S20"), r"\|S20"),
        (np.zeros((80, 2), [("x", "f8")]), r"\[\('x', '<f8'\)\]"),
    ],
)
def test_arrays_hold_real_numbers(points: np.ndarray, type_: str, tmp_path: Path) -> None:
    file = tmp_path / "points.npy"
    np.save(file, points)
    with pytest.raises(ValueError, match=rf"points\.npy: must hold real numbers, got the type {type_}"):
        traced_in(file)
    if points.dtype.kind in "cb":
        with h5py.File(tmp_path / "points.h5", "w") as opened:
            opened["cells"] = points
        with pytest.raises(ValueError, match=rf"points\.h5: must hold real numbers, got the type {type_}"):
            traced_in(tmp_path / "points.h5")


@pytest.mark.parametrize("type_", ["int64", "uint16", "float32"])
def test_arrays_may_hold_numbers_of_any_size(type_: str, tmp_path: Path) -> None:
    points = np.round(5000 * (ELLIPSE + 3)).astype(type_)
    np.save(tmp_path / "points.NPY.npy", points)
    (tmp_path / "points.NPY.npy").rename(tmp_path / "points.NPY")
    assert traced_in(tmp_path / "points.NPY").length == pytest.approx(5000 * 9.68845, rel=1e-3)


def test_what_is_no_outline_is_refused_by_name(tmp_path: Path) -> None:
    (tmp_path / "empty.npy").touch()
    (tmp_path / "points.dat").touch()
    np.savetxt(tmp_path / "crossing.csv", crossing(), delimiter=",")
    for name, message in (
        ("empty.npy", "empty.npy: "),
        ("points.dat", "points.dat: the name must end in one of .csv"),
        ("crossing.csv", "crossing.csv: the curve through the points crosses itself"),
    ):
        with pytest.raises(ValueError, match=message):
            traced_in(tmp_path / name)
