"""Keys of runs: equal scenes under one revision of the results share a key, so no run is computed twice."""

from __future__ import annotations

import hashlib
import json

from solver.revision import RESULTS_REVISION
from solver.scene import Scene

DISTRIBUTION = "vesicle-ensemble"


def run_key(scene: Scene, revision: int | None = None) -> str:
    """Return the key of the run that a scene describes under the installed solver.

    Parameters
    ----------
    scene : Scene
    revision : int, optional
        Of the results; left out, that of the installed solver.

    Returns
    -------
    str
        32 hexadecimal digits: SHA-256 of the canonical JSON (sorted keys) of the scene, without its
        units, and of the revision.
    """
    # Adding 0.0 turns -0.0 into 0.0: the two compare equal, so equal scenes must not differ by it.
    canonical = json.loads(
        scene.model_dump_json(exclude={"units"}), parse_float=lambda digits: float(digits) + 0.0
    )
    identity = {"scene": canonical, "results_revision": RESULTS_REVISION if revision is None else revision}
    text = json.dumps(identity, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:32]
