"""The JSON Schema of documents accepts what the models accept, and editors learn from it what fields mean."""

from __future__ import annotations

from typing import Any

import pytest

from ensemble.config.document_schema import document_schema
from ensemble.config.documents import preset_document, preset_names
from ensemble.config.overrides import override
from ensemble.config.study import Study
from ensemble.config.validation import validated
from ensemble.questions import kind_of
from solver.scene import Model

jsonschema_rs = pytest.importorskip("jsonschema_rs")


def accepts(model: type[Model], document: dict[str, Any]) -> bool:
    """Whether the schema of a model accepts a document."""
    return bool(jsonschema_rs.validator_for(document_schema(model)).is_valid(document))


@pytest.mark.parametrize("name", preset_names())
def test_every_preset_is_valid(name: str) -> None:
    document = preset_document(name)
    assert accepts(kind_of(document).document_type, document)


@pytest.mark.parametrize(
    ("name", "path", "value"),
    [
        ("doublet-shear", "horizont", 5.0),
        ("doublet-shear", "flow.kind", "whirl"),
        ("doublet-shear", "flow.speed", 1.0),
        ("doublet-shear", "flow.rate", -1.0),
        ("doublet-shear", "vesicles.0.reduced_area", 1.2),
        ("doublet-shear", "vesicles.0.center", [0.0]),
        ("doublet-shear", "numerics.points", 7),
        ("doublet-shear", "adhesion.hamaker", "strong"),
        ("suspension-shear", "arrangement.count", 0),
        ("critical-hamaker", "search.tolerance", 0.6),
        ("critical-hamaker", "search.low", ["lost"]),
        ("critical-hamaker", "sweep.values", []),
        ("critical-hamaker", "scene.horizon", 0.0),
    ],
)
def test_a_wrong_field_is_refused_as_the_model_refuses_it(name: str, path: str, value: Any) -> None:
    model = kind_of(preset_document(name)).document_type
    document = override(preset_document(name), {path: value})
    with pytest.raises(ValueError, match=path.split(".")[-1]):
        validated(model, document)
    assert not accepts(model, document)


@pytest.mark.parametrize("missing", ["name", "scene", "search", "sweep"])
def test_a_missing_table_is_refused(missing: str) -> None:
    document = preset_document("critical-hamaker")
    del document[missing]
    assert not accepts(Study, document)


def test_descriptions_come_from_the_docstrings() -> None:
    schema = document_schema(Study)
    assert schema["description"].startswith("A boundary between outcomes")
    assert "Attributes" not in str(schema)
    tables = {"Study": schema} | schema["$defs"]
    undescribed = [
        (table, name)
        for table, description in tables.items()
        for name, field in description.get("properties", {}).items()
        if name != "kind" and "description" not in field
    ]
    assert undescribed == []
    assert schema["$defs"]["Search"]["properties"]["tolerance"]["description"].startswith("Relative width")
    # That of a field which several flows inherit.
    assert "gradient" in schema["$defs"]["Shear"]["properties"]["rate"]["description"]


def test_a_number_with_a_unit_names_it() -> None:
    tables = document_schema(Study)["$defs"]
    assert tables["Scene"]["properties"]["horizon"]["x-unit"] == "mu R^3 kappa^-1"
    assert tables["Vesicle"]["properties"]["center"]["prefixItems"][0]["x-unit"] == "R"
    assert "x-unit" not in tables["Vesicle"]["properties"]["reduced_area"]
