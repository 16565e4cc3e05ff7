"""Presets are what the paper computed, and studies refuse what cannot work."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path

import pytest
from scipy.optimize import brentq
from scipy.special import ellipe

from ensemble.config.documents import load_scene, load_study, preset_names
from ensemble.config.study import Study
from solver.scene import PowerLaw, Scene, Shear, Trap

DOUBLET_STUDIES = (
    "critical-extension-hamaker",
    "critical-extension-rate",
    "critical-hamaker-contrast",
    "critical-hamaker-reduced-area",
    "critical-hamaker-short-range",
    "critical-hamaker",
    "critical-separation-rate",
)
STUDIES = (
    *DOUBLET_STUDIES,
    "critical-hamaker-flow-type",
    "critical-hamaker-surface",
    "critical-viscosity-contrast",
)
PUBLISHED = (
    "doublet-draining",
    "doublet-equilibrium",
    "doublet-quiescent",
    "doublet-shear",
    "doublet-trap",
    "pair-extension",
    "vesicle-shear",
)
MANY = ("cluster-quiescent", "suspension-shear")
SCENES = (*PUBLISHED, *MANY, "doublet-linear", "doublet-ramp", "vesicle-poiseuille", "doublet-unequal")

MAPS = ("shear-hamaker-map",)
MEASUREMENTS = ("adhesion-measurement",)

HAMAKER = load_study("critical-hamaker")


def ellipse_half_width(reduced_area: float, length: float) -> float:
    """Short semiaxis of the ellipse of this reduced area and length, from its perimeter 4aE(1 − b²/a²)."""

    def excess(ratio: float) -> float:
        return math.pi**2 * ratio / (4 * ellipe(1 - ratio**2) ** 2) - reduced_area

    ratio = brentq(excess, 1e-3, 1.0)
    return float(ratio * length / (4 * ellipe(1 - ratio**2)))


def test_all_presets_ship() -> None:
    assert preset_names() == tuple(sorted(STUDIES + SCENES + MAPS + MEASUREMENTS))


@pytest.mark.parametrize("name", STUDIES)
def test_a_study_is_called_as_its_preset(name: str) -> None:
    assert load_study(name).name == name


@pytest.mark.parametrize("name", preset_names())
def test_every_preset_says_what_it_is_and_where_it_comes_from(name: str) -> None:
    text = (
        Path(__file__).parents[3].joinpath("ensemble", "presets", f"{name}.toml").read_text(encoding="utf-8")
    )
    comment = [line for line in text.split("\n\n")[0].splitlines() if line.startswith("# ")]
    sources = ("Quaife, Veerapaneni and Young", "Keller and Skalak", "Kaoui, Biros and Misbah")
    assert any(source in line for line in comment for source in sources)


def test_no_doublet_starts_in_contact() -> None:
    scenes = [load_scene(name) for name in PUBLISHED]
    for study in map(load_study, DOUBLET_STUDIES):
        scenes += [study.scene_at(at, study.search.limits[0]) for at in study.places]
    doublets = [scene.vesicles for scene in scenes if len(scene.vesicles) == 2]
    assert len(doublets) == len(scenes) - 1
    for left, right in doublets:
        assert left.angle == right.angle == math.pi / 2
        widths = sum(ellipse_half_width(vesicle.reduced_area, vesicle.length) for vesicle in (left, right))
        assert right.center[0] - left.center[0] - widths > 0.4


def test_parameters_of_the_published_scenes() -> None:
    shear = load_scene("doublet-shear")
    assert [vesicle.center for vesicle in shear.vesicles] == [(-1.5, 0.0), (1.5, 0.0)]
    assert {vesicle.reduced_area for vesicle in shear.vesicles} == {0.9}
    assert shear.adhesion == PowerLaw(hamaker=1.5, distance=0.4)
    assert shear.flow == Shear(rate=0.5)
    trap = load_scene("doublet-trap")
    assert {vesicle.reduced_area for vesicle in trap.vesicles} == {0.8}
    assert trap.adhesion == PowerLaw(hamaker=0.7, distance=0.4)
    assert trap.flow == Trap(rate=0.09)
    assert trap.start.relaxed
    assert trap.start.tilt == 1e-3
    assert load_scene("doublet-quiescent").flow is None
    single = load_scene("vesicle-shear")
    assert len(single.vesicles) == 1
    assert single.adhesion is None


@pytest.mark.parametrize("name", MANY)
def test_tens_of_vesicles_begin_within_reach_of_adhesion_but_apart(name: str) -> None:
    scene = load_scene(name)
    assert len(scene.vesicles) == 24
    assert scene == load_scene(name)
    assert scene.vesicles != load_scene(name, ["arrangement.seed=2"]).vesicles
    pair = load_scene("doublet-shear")
    assert scene.adhesion == pair.adhesion
    assert scene.flow in (None, pair.flow)


def test_scene_at_sets_both_parameters_and_nothing_else() -> None:
    scene = HAMAKER.scene_at((1.25,), 0.8)
    assert scene.flow == Shear(rate=1.25)
    assert scene.adhesion == PowerLaw(hamaker=0.8, distance=0.4)
    restored = scene.model_copy(update={"flow": HAMAKER.scene.flow, "adhesion": HAMAKER.scene.adhesion})
    assert restored == HAMAKER.scene
    trap = load_study("critical-extension-rate").scene_at((0.65,), 0.1)
    assert [vesicle.reduced_area for vesicle in trap.vesicles] == [0.65, 0.65]


def test_the_key_depends_on_the_contents_alone() -> None:
    assert len(HAMAKER.key) == 16
    assert int(HAMAKER.key, 16) >= 0
    assert load_study("critical-hamaker").key == HAMAKER.key
    assert Study.model_validate_json(HAMAKER.model_dump_json()).key == HAMAKER.key
    keys = {
        load_study("critical-hamaker", overrides).key
        for overrides in (["search.tolerance=0.02"], ["scene.numerics.points=96"], ["sweep.values=[0.5]"])
    }
    assert len(keys | {HAMAKER.key}) == 4


def test_the_key_is_the_same_in_another_process() -> None:
    program = "from ensemble.config.documents import load_study; print(load_study('critical-hamaker').key)"
    other = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=120
    )
    assert other.stdout.strip() == HAMAKER.key


def test_a_field_that_is_gone_is_refused_where_it_is_given_and_read_where_it_is_stored() -> None:
    with pytest.raises(ValueError, match="extensions is gone: horizon is the latest time of a run"):
        load_scene("doublet-shear", ["criteria.extensions=4.0"])
    scene = load_scene("doublet-shear")
    stored = scene.model_dump(mode="json")
    stored["criteria"] |= {"extensions": 4.0, "gap_growth": 0.1}
    assert Scene.model_validate(stored) == scene


def test_tolerance_and_overrides_reach_the_study() -> None:
    study = load_study("critical-hamaker", ["scene.vesicles.reduced_area=0.8", "search.tolerance=0.05"])
    assert study.search.tolerance == 0.05
    assert [vesicle.reduced_area for vesicle in study.scene.vesicles] == [0.8, 0.8]


def test_files_are_read_as_presets_are(tmp_path: Path) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text("horizon = 5.0\n[[vesicles]]\n", encoding="utf-8")
    assert load_scene(scene, ["vesicles.0.reduced_area=0.7"]).vesicles[0].reduced_area == 0.7
    assert load_scene(str(scene)) == Scene.model_validate({"horizon": 5.0, "vesicles": [{}]})


def test_what_is_certified_has_been_scanned() -> None:
    with pytest.raises(ValueError, match=r"search\.certify: True — needs search\.scan of at least 1"):
        load_study("critical-hamaker", ["search.certify=true", "search.scan=0"])


def test_a_mistyped_preset_is_told_the_nearest_one_and_an_unknown_name_all() -> None:
    with pytest.raises(ValueError, match=r"'critical-hamker' is neither.*did you mean 'critical-hamaker'"):
        load_study("critical-hamker")
    with pytest.raises(ValueError, match="'tulip' is neither") as refused:
        load_study("tulip")
    assert all(name in str(refused.value) for name in preset_names())


def test_a_field_of_another_table_is_not_suggested_for_itself() -> None:
    with pytest.raises(ValueError, match=r"adhesion\.reduced_area: 0\.9 — extra inputs are not permitted$"):
        load_scene("doublet-shear", ["adhesion.reduced_area=0.9"])


def test_a_file_that_is_not_toml_is_named(tmp_path: Path) -> None:
    broken = tmp_path / "broken.toml"
    broken.write_text("horizon = = 5", encoding="utf-8")
    with pytest.raises(ValueError, match=r"broken\.toml: "):
        load_scene(broken)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("search.tolerance=0.6", "search.tolerance: 0.6 — input should be less than or equal to 0.5"),
        ("search.scan=101", "search.scan: 101 — input should be less than or equal to 100"),
        ("search.limits=[5.0, 0.05]", "search.limits: [5.0, 0.05] — the first must be less than the second"),
        ("search.limits=[1.001, 1.002]", "search.limits: [1.001, 1.002] — must be further apart than"),
        ("search.limits=[0.0, 1.0]", "search.limits.0: 0.0 — input should be greater than 0"),
        (
            "search.guesses=[{at = 0.5, bracket = [0.3, 0.2]}]",
            "search.guesses.0.bracket: [0.3, 0.2] — the first must be less than the second",
        ),
        ("search.low=['failed']", "search.low: ['failed'] — undecided and failed are no answers"),
        ("search.low=['bound']", "search.high: ['bound'] — must share no outcome with low"),
        ("search.high=[]", "search.high: [] — tuple should have at least 1 item"),
        ("search.parameter=flow.kind", "search.parameter: 'flow.kind' — must be the dotted path of a number"),
        ("search.parameter=adhesion", "search.parameter: 'adhesion' — must be the dotted path of a number"),
        (
            "search.parameter=flow.speed",
            "search.parameter: 'flow.speed' — must be the dotted path of a number",
        ),
        ("search.parameter=start.relaxed", "search.parameter: 'start.relaxed' — must be the dotted path"),
        ("search.parameter=vesicles.2.angle", "search.parameter: vesicles.2: no such element, there are 2"),
        ("search.parameter=flow.rate", "sweep.parameter: 'flow.rate' — must differ from search.parameter"),
        ("sweep.values=[]", "sweep.values: [] — tuple should have at least 1 item"),
        ("sweep.values=[0.5, 0.5]", "sweep.values: [0.5, 0.5] — values must be distinct"),
        ("sweep.values=[0.5, inf]", "sweep.values.1: inf — input should be a finite number"),
        ("sweep.values=[0.5, -1.0]", "flow.rate: -1.0 — input should be greater than or equal to 0"),
        ("scene.vesicles.reduced_area=1.2", "scene.vesicles.0.reduced_area: 1.2 — input should be less than"),
    ],
)
def test_a_study_that_cannot_work_is_refused_by_field(change: str, message: str) -> None:
    with pytest.raises(ValueError, match=r"^critical-hamaker: ") as refused:
        load_study("critical-hamaker", [change])
    assert str(refused.value).removeprefix("critical-hamaker: ").startswith(message)


def test_a_parameter_inside_the_other_is_refused() -> None:
    with pytest.raises(ValueError, match="must differ"):
        load_study(
            "critical-hamaker",
            [
                "search.parameter=vesicles.0.reduced_area",
                "sweep.parameter=vesicles.reduced_area",
                "search.limits=[0.5, 0.9]",
            ],
        )
