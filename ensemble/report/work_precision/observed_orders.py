"""Observed orders of convergence of the integrators."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

import numpy as np

from ensemble.report.work_precision.work_precision_document import Measurement, ObservedOrder

# Measurements within this factor of the least error at the same number of points are not fitted: there the
# error in space, or that of the converged run, hides the error of the integrator.
FLOOR = 3.0


def observed_orders(measurements: Sequence[Measurement]) -> list[ObservedOrder]:
    """Fit the order of convergence of each series of measurements by least squares.

    Parameters
    ----------
    measurements : sequence of Measurement
        Ordered by scene, method and number of points.

    Returns
    -------
    list of ObservedOrder
        One for each scene, method and number of points.  `FLOOR` says what is left out of the fit.
    """
    least: dict[tuple[str, int], float] = {}
    for measurement in measurements:
        if measurement.error_rms is not None:
            place = measurement.scene, measurement.points
            least[place] = min(least.get(place, np.inf), measurement.error_rms)
    orders = []
    for (scene, method, points), series in groupby(measurements, lambda m: (m.scene, m.method, m.points)):
        fitted = [
            (measurement.evaluations, measurement.error_rms)
            for measurement in series
            if measurement.error_rms is not None and measurement.error_rms > FLOOR * least[scene, points]
        ]
        order = None
        if len(fitted) > 1:
            evaluations, errors = np.log(np.array(fitted)).T
            order = -float(np.polyfit(evaluations, errors, 1)[0])
        orders.append(
            ObservedOrder(scene=scene, method=method, points=points, order=order, fitted=len(fitted))
        )
    return orders
