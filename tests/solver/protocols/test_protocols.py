"""Protocols have the factors that documents name, exact slopes and integrals, and break where they say."""

from __future__ import annotations

import math
import pickle
import tomllib
from itertools import pairwise

import numpy as np
import pytest
from pydantic import ValidationError

from solver.protocols import PROTOCOLS, Constant, Piece, Ramp, RateProtocol, Sine, Steps
from solver.scene import Numerics, Scene, Shear
from solver.simulation.simulate import simulate

MANY = [
    Constant(),
    Ramp(begin=2.0, duration=3.0, start=0.5, end=2.0),
    Ramp(duration=3.0),
    Steps(times=(1.0, 4.0), factors=(1.0, 0.0, 2.5)),
    Sine(mean=0.5, amplitude=1.5, period=3.0, phase=0.4),
]
every_protocol = pytest.mark.parametrize("protocol", MANY, ids=lambda protocol: protocol.kind)
IN_SHEAR = "horizon = 10.0\nvesicles = [{}]\nflow = {kind = 'shear', rate = 0.5}\n"


def scene(protocol: str) -> Scene:
    return Scene.model_validate(tomllib.loads(IN_SHEAR + f"protocol = {protocol}"), context={})


def test_every_registered_protocol_is_tested() -> None:
    assert {type(protocol) for protocol in MANY} == set(PROTOCOLS)


def test_factors() -> None:
    _, late, ramp, steps, sine = MANY
    assert [late.factor(time) for time in (0.0, 2.0, 3.0, 5.0, 9.0)] == [0.5, 0.5, 1.0, 2.0, 2.0]
    assert [ramp.factor(time) for time in (0.0, 1.5, 3.0, 4.0)] == [0.0, 0.5, 1.0, 1.0]
    assert [steps.factor(time) for time in (0.0, 0.99, 1.0, 3.9, 4.0, 9.0)] == [1.0, 1.0, 0.0, 0.0, 2.5, 2.5]
    assert sine.factor(1.2) == pytest.approx(0.5 + 1.5 * math.sin(2 * math.pi * 1.2 / 3.0 + 0.4))
    assert [protocol.breaks for protocol in MANY] == [(), (2.0, 5.0), (3.0,), (1.0, 4.0), ()]


@every_protocol
def test_slopes_and_integrals_are_those_of_the_factor(protocol: RateProtocol) -> None:
    for start, end in pairwise((0.0, *protocol.breaks, 8.0)):
        inside = start + (end - start) * np.linspace(0.1, 0.9, 5)
        piece = protocol.pieces[protocol.piece_at(start)]
        for time in inside:
            assert piece.factor(time) == pytest.approx(protocol.factor(time), abs=1e-14)
            difference = (protocol.factor(time + 1e-5) - protocol.factor(time - 1e-5)) / 2e-5
            assert piece.slope(time) == pytest.approx(difference, abs=1e-8)
            difference = (protocol.integral(time + 1e-5) - protocol.integral(time - 1e-5)) / 2e-5
            assert difference == pytest.approx(protocol.factor(time), abs=1e-9)
    assert protocol.integral(0.0) == 0
    for end in protocol.breaks:
        assert protocol.integral(end - 1e-9) == pytest.approx(protocol.integral(end), abs=1e-8)


def test_the_course_is_built_once_and_stays_with_its_protocol(monkeypatch: pytest.MonkeyPatch) -> None:
    """A time step asks for it many times, and a protocol may have thousands of pieces."""
    built = []
    pieces = Steps.pieces.fget

    def counted(protocol: Steps) -> tuple[Piece, ...]:
        built.append(protocol)
        return pieces(protocol)

    monkeypatch.setattr(Steps, "pieces", property(counted))
    steps = Steps(times=(1.0, 4.0), factors=(1.0, 0.0, 2.5))
    assert [steps.next_break(time) for time in (0.0, 1.0, 3.9, 4.0)] == [1.0, 4.0, 4.0, math.inf]
    assert [steps.integral(time) for time in (0.5, 2.0, 6.0)] == [0.5, 1.0, 6.0]
    assert steps.factor(5.0) == 2.5
    short = Scene(horizon=2.0, vesicles=[{"reduced_area": 1.0}], flow=Shear(rate=0.5), protocol=steps)
    simulate(short.model_copy(update={"numerics": Numerics(points=16, tolerance=1e-3)}))
    assert built == [steps]
    other = steps.model_copy(update={"factors": (1.0, 3.0, 2.5)})
    assert other.factor(2.0) == 3.0
    assert steps == pickle.loads(pickle.dumps(steps)) == Steps(times=steps.times, factors=steps.factors)
    assert hash(steps) == hash(Steps(times=steps.times, factors=steps.factors))


@every_protocol
def test_what_a_protocol_says_of_itself(protocol: RateProtocol) -> None:
    times = np.linspace(0, 30, 3001)
    factors = np.array([protocol.factor(time) for time in times])
    for horizon in (*protocol.breaks, 30.0):
        assert np.abs(factors[times < horizon]).max() <= protocol.largest(horizon)
        last = protocol.last_piece(horizon)
        inside = factors[(times >= protocol.course.pieces[last].start) & (times < horizon)]
        constant = inside[0] if np.ptp(inside) == 0 else None
        assert protocol.course.pieces[last].constant == constant
    assert np.abs(factors).max() == pytest.approx(protocol.largest(30.0), rel=1e-4)
    assert protocol.title
    assert pickle.loads(pickle.dumps(protocol)) == protocol  # ranks send scenes to each other


@pytest.mark.parametrize(
    ("protocol", "message"),
    [
        ("{kind = 'ramp'}", "protocol.duration\n.*required"),
        ("{kind = 'ramp', duration = 0}", "protocol.duration\n.*greater than 0"),
        ("{kind = 'ramp', duration = 1, end = -1}", "protocol.end\n.*greater than or equal to 0"),
        ("{kind = 'ramp', duration = '3 m'}", "protocol.duration\n.*unit of time"),
        ("{kind = 'steps', times = [2, 1], factors = [1, 2, 3]}", "protocol\n.*times must ascend"),
        (
            "{kind = 'steps', times = [1, 2], factors = [1, 2]}",
            "one more than times, 3, got 2",
        ),
        ("{kind = 'sine', period = -1}", "protocol.period\n.*greater than 0"),
        ("{kind = 'spline'}", "expected tags: 'constant', 'ramp', 'steps', 'sine'"),
    ],
)
def test_bad_ones_are_refused_by_name(protocol: str, message: str) -> None:
    with pytest.raises(ValidationError, match="(?s)" + message):
        scene(protocol)


@pytest.mark.parametrize("given", ["kind = 'ramp', duration", "kind = 'sine', period"])
def test_a_time_scale_is_no_shorter_than_a_millionth_of_the_horizon(given: str) -> None:
    """With 1e-300 a run stood at time 0 for ever."""
    for value in ("1e-300", "9.99e-6"):
        with pytest.raises(ValidationError, match=f"protocol.{given.split()[-1]} must be at least 1e-05"):
            scene(f"{{{given} = {value}}}")
    shortest = scene(f"{{{given} = 1e-5}}")
    short = Numerics(points=16, tolerance=1e-3, work_limit=200)
    ended = simulate(shortest.model_copy(update={"numerics": short}))
    assert ended.time > 0
    assert ended.failure is None or "work limit" in ended.failure


def test_a_protocol_needs_a_flow() -> None:
    with pytest.raises(ValidationError, match="protocol: there is no flow"):
        Scene.model_validate({"horizon": 1.0, "vesicles": [{}], "protocol": {"kind": "ramp", "duration": 1}})


def test_times_take_units() -> None:
    units = "units = {radius = '10 um', bending_modulus = '1e-19 J', viscosity = '1 mPa*s'}\n"
    protocol = "protocol = {kind = 'ramp', begin = '20 s', duration = '1 min'}"
    found = Scene.model_validate(tomllib.loads(units + IN_SHEAR + protocol), context={})
    assert found.protocol == Ramp(begin=2.0, duration=6.0)


def test_a_scene_without_a_protocol_is_written_as_before_there_were_any() -> None:
    plain = Scene(horizon=10.0, vesicles=[{}], flow=Shear(rate=0.5))
    assert "protocol" not in plain.model_dump()
    assert "protocol" not in plain.model_dump_json()
    constant = scene("{kind = 'constant'}")
    assert constant == plain
    assert constant.model_dump_json() == plain.model_dump_json()
    ramped = scene("{kind = 'ramp', duration = 4}")
    assert Scene.model_validate_json(ramped.model_dump_json(), strict=True) == ramped
