"""`ensemble/README.md` is true: its Python runs, its study is valid, its folders exist."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import ensemble
from ensemble.config.documents import preset_document
from ensemble.config.study import Study
from ensemble.report.paper.results import Results
from ensemble.store import Store
from solver import Outcome, simulate
from solver.membrane.curve import positions

FOLDER = Path(ensemble.__file__).parent
README = (FOLDER / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    """Fenced blocks of a language, in their order."""
    return re.findall(rf"^```{language}\n(.*?)^```$", README, re.MULTILINE | re.DOTALL)


@pytest.fixture(scope="module")
def namespace(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What all Python of the README has defined, run in one directory from top to bottom."""
    names: dict[str, Any] = {"__name__": "readme"}
    with pytest.MonkeyPatch.context() as patch:
        directory = tmp_path_factory.mktemp("readme")
        patch.chdir(directory)
        for block in blocks("python"):
            exec(compile(block, "ensemble/README.md", "exec"), names)
    return names | {"directory": directory}


def test_the_example_with_xarray_is_short_and_draws_the_membranes(
    namespace: dict[str, Any],
) -> None:
    directory = namespace["directory"]
    with Store.existing(directory / "ensemble-store") as store:
        run = store.load(namespace["key"])
    frames = run.frames
    assert len(frames.time) == 4
    exact = positions(frames.tangent_angle, frames.center, [vesicle.length for vesicle in run.scene.vesicles])
    for frame in range(4):
        namespace["show"](frame)
        for vesicle, outline in enumerate(namespace["outlines"]):
            drawn = outline.get_xy()[:-1]  # without the first point again
            np.testing.assert_allclose(drawn, exact[frame, vesicle].T, atol=1e-12)
    with Image.open(directory / "membranes.gif") as movie:
        assert movie.n_frames == 4
    (example,) = (block for block in blocks("python") if "open_datatree" in block)
    code = [line for line in example.splitlines() if line.strip() and "import " not in line]
    assert len(code) <= 15


def test_the_section_compares_what_it_asks_for(namespace: dict[str, Any], tmp_path: Path) -> None:
    generator = namespace["SECTION"].generate(True)
    (case,) = next(generator).cases
    with Store.open(tmp_path / "store") as store:
        store.save(simulate(case.scene))
        with pytest.raises(StopIteration) as finished:
            generator.send(Results(store))
    _, (comparison,) = finished.value.value.blocks
    assert comparison.agrees is True
    assert comparison.runs == [case.key]


def test_the_study_is_valid() -> None:
    text, sweeps, _ = blocks("toml")
    study = Study.model_validate(tomllib.loads(text))
    assert study.scene_at((0.8,), 2.0).vesicles[0].reduced_area == 0.8
    assert study.search.low == (Outcome.BOUND,)
    surface = preset_document("critical-hamaker-surface")
    assert Study.model_validate(surface | tomllib.loads(sweeps)).places[-1] == (1.5, 0.9)


def test_all_folders_are_listed() -> None:
    listed = re.findall(r"`(\w+)/`", README.partition("## The folders")[2].partition("**To add")[0])
    there = {path.parent.name for path in FOLDER.glob("*/__init__.py")}
    assert set(listed) == there
    assert len(listed) == len(there)
