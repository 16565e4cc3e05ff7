"""Keys of runs: equal scenes under the same solver version share one key, so no run is computed twice."""

from __future__ import annotations

import hashlib
import json
from functools import cache
from importlib.metadata import version

from solver.scene import Scene

DISTRIBUTION = "vesicle-ensemble"


def run_key(scene: Scene) -> str:
    """Key of the run that this scene describes under the installed solver version.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    str
        32 hexadecimal digits: SHA-256 of the canonical JSON (sorted keys) of scene and solver version.
    """
    # Adding 0.0 turns -0.0 into 0.0: the two compare equal, so equal scenes must not differ by it.
    canonical = json.loads(scene.model_dump_json(), parse_float=lambda digits: float(digits) + 0.0)
    identity = {"scene": canonical, "solver": _solver_version()}
    text = json.dumps(identity, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


@cache
def _solver_version() -> str:
    # Reading the metadata takes longer than hashing a scene.
    return version(DISTRIBUTION)
