"""Files with points along the outline of a vesicle."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from solver.membrane.traced_curve import Array, TracedCurve

SUFFIXES = (".csv", ".txt", ".npy", ".h5", ".hdf5")


def traced_in(path: Path) -> TracedCurve:
    """Return the curve through the points in a file.

    Parameters
    ----------
    path : Path
        Two columns of real numbers, x and y: of text, separated by commas, semicolons or blanks, after a
        heading or not; or the array of a ``.npy`` file; or the only array of that shape in an HDF5 file.

    Returns
    -------
    TracedCurve

    Raises
    ------
    ValueError
        If there is no such file, or it holds no closed curve; names the file.
    """
    from solver.membrane.traced_curve import traced_curve

    if not path.is_file():
        raise ValueError(f"{str(path)!r} is no file")
    if path.suffix.lower() not in SUFFIXES:
        raise ValueError(f"{path}: the name must end in one of {', '.join(SUFFIXES)}")
    try:
        return traced_curve(_points_in(path))
    except (ValueError, OSError, EOFError) as error:
        raise ValueError(f"{path}: {error}") from error


def _points_in(path: Path) -> Array:
    import numpy as np

    suffix = path.suffix.lower()
    if suffix == ".npy":
        return _real(np.load(path, allow_pickle=False))
    if suffix in (".h5", ".hdf5"):
        return _only_points_of(path)
    lines = path.read_text(encoding="utf-8").replace(",", " ").replace(";", " ").splitlines()
    rows = [line.split() for line in lines if line.strip() and not line.startswith("#")]
    if rows and not _is_number(rows[0][0]):
        del rows[0]  # the heading
    if any(len(row) != 2 for row in rows):
        raise ValueError("every line must have two numbers, x and y")
    return np.array([[float(number) for number in row] for row in rows]).reshape(-1, 2)


def _only_points_of(path: Path) -> Array:
    import h5py

    found: dict[str, Array] = {}

    def look(name: str, node: object) -> None:
        if isinstance(node, h5py.Dataset) and node.ndim == 2 and node.shape[1] == 2:
            found[name] = _real(node[()])

    with h5py.File(path) as file:
        file.visititems(look)
    if len(found) != 1:
        names = f": {', '.join(found)}" if found else ""
        raise ValueError(f"must hold one array with two columns, got {len(found)}{names}")
    return found.popitem()[1]


def _real(values: object) -> Array:
    """Return values as numbers, unless something would be lost or made up."""
    import numpy as np

    array = np.asarray(values)
    if array.dtype.kind not in "iuf":
        raise ValueError(f"must hold real numbers, got the type {array.dtype}")
    return array.astype(np.float64)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
