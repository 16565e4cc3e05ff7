"""Tables on a terminal: nothing is cut, numbers stay in one piece, and what all rows share is said once."""

from __future__ import annotations

from io import StringIO

import numpy as np
from rich.console import Console, RenderableType
from rich.table import Table

from ensemble.display.result_tables import boundary_table, bracket_text, fields_table, for_people, list_table
from ensemble.questions.scene_question import SceneQuestion
from ensemble.search.boundary import Boundary
from ensemble.store import Store
from ensemble.store.listing import Listing
from tests.api.stores import example_boundary, fill

WIDTH = 80


def shown(table: RenderableType) -> list[str]:
    output = StringIO()
    Console(file=output, width=WIDTH).print(table)
    return output.getvalue().splitlines()


def converged() -> Boundary:
    boundary = example_boundary()
    return boundary.model_copy(update={"points": boundary.points[:-1]})


def test_a_boundary_fits_into_eighty_columns_with_each_bracket_in_one_piece() -> None:
    boundary = converged()
    lines = shown(for_people(boundary_table(boundary)))
    assert max(map(len, lines)) <= WIDTH
    for point in boundary.points:
        assert sum(bracket_text(point) in line for line in lines) == 1
    assert "outcomes: separated | bound" in "\n".join(lines), "said once, below"
    assert sum("separated" in line for line in lines) == 1
    assert "certified by" not in "\n".join(lines), "no point is certified"


def test_what_differs_between_rows_stays_a_column() -> None:
    table = Table("a", "b", "c")
    table.add_row("1", "same", "–")
    table.add_row("2", "same", "3")
    lines = shown(for_people(table))
    assert lines[1].split() == ["a", "c"]
    assert lines[-1].strip() == "All rows: b: same"


def test_a_single_row_keeps_its_columns() -> None:
    table = Table("a", "b")
    table.add_row("1", "–")
    assert shown(for_people(table))[1].split() == ["a"], "a column without a value says nothing"


def test_fields_of_inner_tables_have_a_row_each_and_words_of_no_language() -> None:
    document = {
        "vesicles": [{"length": 6.25}, {"length": 7.0}],
        "settled": True,
        "perturbations": [],
        "gap": None,
        "time": np.float64(2),
    }
    cells = dict(zip(*(column.cells for column in fields_table(document).columns), strict=True))
    assert cells == {
        "vesicles.0.length": "6.25",
        "vesicles.1.length": "7",
        "settled": "yes",
        "perturbations": "–",
        "gap": "–",
        "time": "2",
    }


def test_a_key_is_never_cut() -> None:
    key = 32 * "f"
    assert any(
        key in line
        for line in shown(
            for_people(fields_table({"scene.criteria.separated_distance": 12.0, "run_key": key}))
        )
    )


def test_a_list_shows_what_was_asked_for(tmp_path) -> None:
    fill(tmp_path / "store")
    with Store.existing(tmp_path / "store") as store:
        listing = Listing(("gap<0.5", "outcome=bound", "report=null"), sort="-time")
        answers = SceneQuestion.all_stored(store, listing, [])
        assert [column.heading for column in answers.columns][-2:] == ["gap", "time"]
        lines = shown(list_table(answers.columns, answers.json_documents))
    assert max(map(len, lines)) <= WIDTH
