"""Measures adhesion from the critical rates that the product itself computes: what was put in must come out.

`python -m tests.benchmarks.adhesion_measurements` prints, for each adhesion and reduced area, the critical
rate, the adhesion that is found from it with its error, and the processor time of the measurement.
"""

from __future__ import annotations

import time
from typing import Any

from ensemble.config.adhesion_measurement import AdhesionMeasurement, InputErrors
from ensemble.config.documents import load_scene
from ensemble.questions.branches import BranchQuestion
from ensemble.questions.measurement_question import measure
from solver.scene import Scene

STRENGTHS = (0.4, 0.7, 1.2)
AREAS = (0.7, 0.8, 0.9)
_FIRST_RATE = 0.07  # of the strength, as a part of it: the pair rests side by side there


def critical_rate(hamaker: float, reduced_area: float) -> float:
    """Compute the extension rate at which a pair that rests side by side is lost."""
    changes = [f"adhesion.hamaker={hamaker}", f"vesicles.reduced_area={reduced_area}"]
    scene = load_scene("doublet-trap", [*changes, f"flow.rate={_FIRST_RATE * hamaker}"])
    document = BranchQuestion(scene, "flow.rate", None).answer(None).json_document()
    return float(document["folds"][0]["value"])


def answer_about(scene: Scene, **errors: float) -> dict[str, Any]:
    """Measure the adhesion of the pair in a scene."""
    measurement = AdhesionMeasurement(name="trap", errors=InputErrors(**errors), scene=scene)
    return measure(measurement, None, lambda step: None).json_document()


def measured(rate: float, reduced_area: float) -> dict[str, Any]:
    """Measure the adhesion from a critical rate."""
    changes = [f"flow.rate={rate!r}", f"vesicles.reduced_area={reduced_area}"]
    return answer_about(load_scene("doublet-trap", changes))


def main() -> None:
    print("| H | reduced area | critical rate | found | error | seconds |\n|---|---|---|---|---|---|")
    for reduced_area in AREAS:
        for hamaker in STRENGTHS:
            rate = critical_rate(hamaker, reduced_area)
            began = time.process_time()
            found = measured(rate, reduced_area)
            seconds = time.process_time() - began
            print(
                f"| {hamaker} | {reduced_area} | {rate:.8f} | {found['hamaker']:.8f} "
                f"| {found['hamaker_error']:.1e} | {seconds:.0f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
