"""The question how strong an adhesion is, from the extension rate at which a trap ends side by side."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, reduce
from operator import getitem
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Final, NamedTuple, Self

from ensemble.config.adhesion_measurement import INPUTS, AdhesionMeasurement
from ensemble.config.dotted_paths import parameter_value
from ensemble.config.measured import Measured, measured_document, measured_values
from ensemble.config.overrides import override
from ensemble.config.validation import validated
from ensemble.questions.branches import NoAnswer, opened, run_of
from ensemble.questions.question import Answer, Question
from ensemble.questions.size_limits import MOST_VESICLES_SWEPT, limit_vesicles
from solver.dimensions import ADHESION_ENERGY, HAMAKER, RATE, TIME
from solver.scene import Scene

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm
    from rich.console import Console
    from rich.table import Table

    from ensemble.display.progress import Display
    from ensemble.store import Store
    from solver.simulation.steady_scenes import SteadyBranch, SteadyPoint
    from solver.simulation.vesicle_shapes import Shapes

_HAMAKER: Final = "adhesion.hamaker"
_RATE, _AREA, _DISTANCE = (INPUTS[name] for name in ("rate", "reduced_area", "distance"))
NUMERICS: Final = "numerics"  # what the points and the search leave, beside the inputs

# Where the pair is looked for first: at the fold of the preset at reduced area 0.8, and with more adhesion.
_KNOWN_FOLD = 0.7 * 0.4 / 0.094
_ABOVE = 1.6
_MOST_TRIALS = 8
_WEAKEST = 1e-3  # of the first strength
_CHANGE = -1e-3  # relative, of an input, in differences; a reduced area cannot always rise
_NEAR = 0.01  # relative distance from the critical strength of the state from which others are followed
_FINER = 1.5  # times the points
_FOUND = 1e-8  # relative accuracy with which the end of a branch is found
_STEPS = (0.005, 0.2)  # of a plan, relative, at least and at most
_STEPS_OF_ANSWER = 6  # that are told
_DECAY = 3.0  # time constants of the slowest perturbation for which a rate is held


class MeasurementQuestion(Question[AdhesionMeasurement]):
    """The question how strong the adhesion of a pair is that a rising rate has turned, see `Question`.

    Attributes
    ----------
    document : AdhesionMeasurement
        What is asked.
    name : str
        The name of the measurement.
    """

    kind = "measurement"
    document_type = AdhesionMeasurement
    marker = "errors"
    command = "measure-adhesion"
    title = "Measure an adhesion"
    answer_title = "measurement"
    has_many_runs = False
    principal_fields = tuple(f"errors.{name}" for name in INPUTS)

    @classmethod
    def check_size(cls, document: Any) -> None:
        """See `Question`.

        Parameters
        ----------
        document : object
            What was sent.
        """
        limit_vesicles(document, MOST_VESICLES_SWEPT, "scene")

    def planned_runs(self) -> list[tuple[Scene, int]]:
        """See `Question`.

        Returns
        -------
        list of (Scene, int)
            The run that is the first of the steady states, with more and more adhesion.
        """
        return [(self.document.scene, _MOST_TRIALS)]

    def answer(
        self,
        communicator: Intracomm | None,
        store: Path | None,
        ranks_per_run: int,
        on_change: Callable[..., None],
    ) -> Answer | None:
        """Follow the pair that rests side by side as its adhesion weakens, to where it is lost.

        Parameters
        ----------
        communicator : Intracomm or None
            Of several ranks the first one answers alone.
        store : Path or None
            Directory of the store that keeps the runs and the branch.
        ranks_per_run : int
            Not used.
        on_change : callable
            Takes what is done next.

        Returns
        -------
        Answer or None
            On the first rank.
        """
        if communicator is not None and communicator.Get_rank() > 0:
            return None
        return measure(self.document, store, on_change)

    @classmethod
    def progress(cls, console: Console, for_program: bool) -> Display:
        """See `Question`.

        Parameters
        ----------
        console : Console
        for_program : bool

        Returns
        -------
        context manager
            Gives a function that takes what is done next.
        """
        from ensemble.display.progress import report_progress, step_lines

        return step_lines(console, _STEPS_OF_ANSWER) if for_program else report_progress(console)

    @classmethod
    def summary(cls, json_document: Mapping[str, Any]) -> str:
        """See `Question`.

        Parameters
        ----------
        json_document : mapping
            As `ensemble measure-adhesion --json` prints it.

        Returns
        -------
        str
            Strength and energy with their errors, which input leaves most of these, and where to look.
        """
        if json_document["failure"] is not None:
            return str(json_document["failure"])
        measured = json_document.get("in_units", {})

        def text(path: str) -> str:
            bare = {"value": reduce(getitem, path.split("."), json_document), "unit": ""}
            number: Mapping[str, Any] = measured.get(path, bare)
            return f"{number['value']:.4g} {number['unit']}".rstrip()

        return (
            f"H = {text('hamaker')} ± {text('hamaker_error')}, "
            f"energy per area {text('adhesion_energy')} ± {text('adhesion_energy_error')}; "
            f"most of the error comes from {json_document['dominant']}; "
            f"look at rates from {text('plan.from')} to {text('plan.to')} in steps of {text('plan.step')}, "
            f"and hold each for {text('plan.hold')}"
        )


def measure(measurement: AdhesionMeasurement, path: Path | None, on_step: Callable[[str], None]) -> Answer:
    """Follow the pair that rests side by side as its adhesion weakens, to where it is lost.

    Parameters
    ----------
    measurement : AdhesionMeasurement
    path : Path or None
        Directory of the store that keeps the runs and the branch.
    on_step : callable
        Takes what is done next.

    Returns
    -------
    Answer
    """
    from ensemble.search.branch_summary import branch_key
    from ensemble.store.branch_record import summary_of
    from solver.steady_states.newton import NoSteadyStateError

    began = clock.perf_counter()
    with opened(path) as store:
        on_step("looking for the pair that rests side by side")
        start = _side_by_side(measurement, store)
        if isinstance(start, str):
            return NoAnswer(start)
        scene, near = start
        weakest = _WEAKEST * parameter_value(scene, _HAMAKER)
        try:
            on_step("following it as its adhesion weakens")
            branch = _weakened(scene, near, weakest)
            loss = _Loss.of(branch)
            dependence = loss.dependence(on_step)
        except NoSteadyStateError as error:
            return NoAnswer(str(error))
        key = branch_key(scene, _HAMAKER, weakest)
        if store is not None and not store.branches.contains(key):
            store.save_branch(summary_of(scene, _HAMAKER, weakest, branch), branch)
    return _MeasuredAdhesion(measurement, loss, dependence, key, clock.perf_counter() - began)


def _side_by_side(measurement: AdhesionMeasurement, store: Store | None) -> tuple[Scene, Shapes] | str:
    """Return a scene with more adhesion and its pair at rest side by side, or why there is none."""
    from solver.analysis.run import Outcome
    from solver.simulation.vesicle_shapes import Shapes

    rate = parameter_value(measurement.scene, _RATE)
    strength = _ABOVE * _KNOWN_FOLD * rate / measurement.adhesion.distance
    for _ in range(_MOST_TRIALS):
        scene = _changed(measurement.scene, {_HAMAKER: strength})
        run = run_of(scene, store)
        if run.outcome is Outcome.FAILED:
            return f"with H = {strength:.4g} the run fails: {run.failure}"
        if run.outcome is Outcome.BOUND:
            return scene, Shapes(run.frames.tangent_angle[-1], run.frames.center[-1])
        strength *= 2
    return f"no adhesion up to H = {strength / 2:.4g} holds the pair side by side at this rate"


class _Dependence(NamedTuple):
    """How the critical strength depends on the inputs: logarithmic derivatives, without units.

    Attributes
    ----------
    rate, area, distance : float
        Of H by these.
    energy : float
        Of the energy of flat membranes over H, by the distance.
    numerics : float
        Relative error of H.
    """

    rate: float
    area: float
    distance: float
    energy: float
    numerics: float

    def of_hamaker(self) -> dict[str, float]:
        """Return the logarithmic derivatives of H, by the inputs, all with their units; its own is κ/R³."""
        return self._with_units(self.distance, 3)

    def of_energy(self) -> dict[str, float]:
        """Return those of the energy per area; its unit is κ/R²."""
        return self._with_units(self.distance + self.energy, 2)

    def _with_units(self, distance: float, power: int) -> dict[str, float]:
        # Of κ/R^power f(rate μR³/κ, area, δ/R), where f has these derivatives.
        return {
            "rate": self.rate,
            "reduced_area": self.area,
            "distance": distance,
            "radius": 3 * self.rate - distance - power,
            "bending_modulus": 1 - self.rate,
            "viscosity": self.rate,
        }


class _Loss(NamedTuple):
    """Where a pair that rests side by side is lost as its adhesion weakens.

    Attributes
    ----------
    kind : str
        Whether it is a fold or a crossing.
    point : SteadyPoint
    shortly_before : SteadyPoint
        A stable state with a little more adhesion.
    """

    kind: str
    point: SteadyPoint
    shortly_before: SteadyPoint

    @classmethod
    def of(cls, branch: SteadyBranch) -> Self:
        from solver.steady_states.newton import NoSteadyStateError

        ends = [("fold", fold) for fold in branch.folds]
        ends += [("crossing", crossing) for crossing in branch.crossings]
        if branch.points[-1].state.stable or not ends:
            raise NoSteadyStateError(f"the pair is not lost as its adhesion weakens: {branch.ended}")
        kind, point = max(ends, key=lambda end: end[1].parameter)
        enough = [each for each in branch.points if each.parameter > (1 + _NEAR) * point.parameter]
        return cls(kind, point, enough[-1] if enough else branch.points[0])

    def dependence(self, on_step: Callable[[str], None]) -> _Dependence:
        """Find the loss again with changed inputs and with more points."""
        from solver.membrane.resampling import resampled_angle
        from solver.simulation.vesicle_shapes import Shapes

        scene, shapes = self.shortly_before.state.scene, self.shortly_before.state.shapes
        strength = parameter_value(scene, _HAMAKER)
        points = shapes.tangent_angle.shape[1]

        def change(path: str, value: float, near: Shapes = shapes) -> float:
            """Return the relative change of the critical strength, as a logarithm."""
            on_step(f"finding how the answer depends on {path}")
            branch = _weakened(_changed(scene, {path: value}), near, strength / 2)
            return math.log(_Loss.of(branch).point.parameter / self.point.parameter)

        finer = 2 * round(_FINER * points / 2)
        refined = Shapes(resampled_angle(shapes.tangent_angle, finer), shapes.center)
        slopes = {
            path: change(path, parameter_value(scene, path) * (1 + _CHANGE)) / math.log1p(_CHANGE)
            for path in (_RATE, _AREA, _DISTANCE)
        }
        numerics = abs(change("numerics.points", finer, refined)) + _FOUND
        return _Dependence(slopes[_RATE], slopes[_AREA], slopes[_DISTANCE], _energy_slope(scene), numerics)


def _changed(scene: Scene, changes: Mapping[str, Any]) -> Scene:
    return validated(Scene, override(scene.model_dump(), changes))


def _weakened(scene: Scene, near: Shapes, weakest: float) -> SteadyBranch:
    """Follow the steady state of a scene as its adhesion weakens, until it is unstable."""
    from solver.simulation.resolution import with_points
    from solver.simulation.steady_scenes import follow_steady_states
    from solver.steady_states.continuation import Limits

    points = near.tangent_angle.shape[1]
    return follow_steady_states(
        lambda strength: with_points(_changed(scene, {_HAMAKER: strength}), points),
        parameter_value(scene, _HAMAKER),
        near,
        Limits(weakest, while_stable=True),
        upward=False,
    )


def _energy_slope(scene: Scene) -> float:
    """Return the logarithmic derivative of the energy of flat membranes by the distance."""
    energies = []
    for factor in (1 - abs(_CHANGE), 1 + abs(_CHANGE)):
        adhesion = _changed(scene, {_DISTANCE: parameter_value(scene, _DISTANCE) * factor}).adhesion
        assert adhesion is not None
        energies.append(math.log(adhesion.flat_membranes.energy))
    return (energies[1] - energies[0]) / (math.log1p(abs(_CHANGE)) - math.log1p(-abs(_CHANGE)))


@dataclass(frozen=True)
class _MeasuredAdhesion(Answer):
    """An adhesion, with its error and the plan of the next experiment."""

    measurement: AdhesionMeasurement
    loss: _Loss
    dependence: _Dependence
    branch_key: str
    seconds: float
    complete: ClassVar[bool] = True

    @cached_property
    def _contributions(self) -> dict[str, float]:
        """The relative errors of the energy that each input leaves, and the numerics."""
        slopes, errors = self.dependence.of_energy(), self.measurement.relative_errors
        inputs = {name: abs(slopes[name]) * error for name, error in errors.items()}
        return inputs | {NUMERICS: self.dependence.numerics}

    def _plan(self) -> dict[str, float]:
        """Say at which rates to look: in steps whose error is no more than that of all other inputs.

        A rate in the middle of a step of the width s is known with the standard error s/√12.
        """
        scene = self.measurement.scene
        rate, slope = parameter_value(scene, _RATE), abs(self.dependence.rate)
        others = math.hypot(*(error for name, error in self._contributions.items() if name != "rate"))
        step = min(max(math.sqrt(12) * others / slope, _STEPS[0]), _STEPS[1])
        reach = max(3 * self.measurement.errors.rate, 2 * step)
        growth = float(self.loss.shortly_before.state.eigenvalues[0].real)
        return {
            "from": rate * max(1 - reach, 0.0),
            "to": rate * (1 + reach),
            "step": rate * step,
            "hold": _DECAY / abs(growth),
        }

    @cached_property
    def _fields(self) -> dict[str, Any]:
        """The answer as JSON data."""
        state = self.loss.point.state
        assert state.scene.adhesion is not None
        hamaker = self.loss.point.parameter
        energy = hamaker * state.scene.adhesion.flat_membranes.energy
        contributions, errors = self._contributions, self.measurement.relative_errors
        slopes = self.dependence.of_hamaker()
        of_hamaker = math.hypot(
            *(slopes[name] * error for name, error in errors.items()), self.dependence.numerics
        )
        return {
            "failure": None,
            "critical_rate": parameter_value(self.measurement.scene, _RATE),
            "lost_at": self.loss.kind,
            "hamaker": hamaker,
            "hamaker_error": hamaker * of_hamaker,
            "adhesion_energy": energy,
            "adhesion_energy_error": energy * math.hypot(*contributions.values()),
            "relative_errors": contributions,
            "dominant": max(contributions, key=contributions.__getitem__),
            "sensitivities": self.dependence.of_energy(),
            "inclination_angle": state.inclination_angle,
            "gap": state.gap,
            "plan": self._plan(),
        }

    @cached_property
    def _measured(self) -> dict[str, Measured]:
        fields, plan = self._fields, self._fields["plan"]
        dimensions = {
            "critical_rate": RATE,
            "hamaker": HAMAKER,
            "hamaker_error": HAMAKER,
            "adhesion_energy": ADHESION_ENERGY,
            "adhesion_energy_error": ADHESION_ENERGY,
        }
        of_plan = {"from": RATE, "to": RATE, "step": RATE, "hold": TIME}
        values = {name: (fields[name], dimension) for name, dimension in dimensions.items()}
        values |= {f"plan.{name}": (plan[name], dimension) for name, dimension in of_plan.items()}
        return measured_values(values, self.measurement.scene.units)

    def json_document(self) -> dict[str, Any]:
        known = {"branch_key": self.branch_key, "wall_seconds": self.seconds}
        return self._fields | known | measured_document(self._measured)

    def table(self) -> Table:
        from ensemble.display.result_tables import fields_table

        return fields_table(self._fields, self._measured)

    @property
    def footer(self) -> str:
        found = MeasurementQuestion.summary(self.json_document())
        return f"{found}; the steady states behind it: ensemble show {self.branch_key}"
