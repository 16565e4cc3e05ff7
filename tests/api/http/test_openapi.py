"""The service answers as its OpenAPI description says, whatever clients send.

`tests/benchmarks/openapi_cases.py` sends many more requests.
"""

from __future__ import annotations

import httpx2
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from ensemble.store.catalog_tables import BOUNDARY_FIELDS, RUN_FIELDS
from tests.api.generated_requests import send_generated_requests

SERVER_ERROR = 500  # this or a higher status would be an error of the service


@pytest.mark.parametrize(
    ("examples", "least_cases"), [(8, 80), pytest.param(30, 300, marks=pytest.mark.long)], ids=["few", "many"]
)
def test_generated_requests_get_the_documented_answers(tmp_path, examples, least_cases):
    options = ("--phases=fuzzing", f"--max-examples={examples}", "--seed=1")
    result = send_generated_requests(tmp_path, *options, seconds=280)
    assert result.passed, result.text
    assert result.cases > least_cases, result.text


@pytest.fixture(scope="module")
def paths(reading: httpx2.Client) -> dict:
    return reading.get("/openapi.json").json()["paths"]


def test_every_route_is_described(paths):
    assert {(method, path) for path, methods in paths.items() for method in methods} == {
        ("post", "/estimate"),
        ("post", "/jobs"),
        ("get", "/jobs"),
        ("get", "/jobs/{identifier}"),
        ("delete", "/jobs/{identifier}"),
        ("get", "/jobs/{identifier}/events"),
        ("get", "/jobs/{identifier}/log"),
        ("get", "/jobs/{identifier}/submission"),
        ("get", "/runs"),
        ("get", "/runs/{key}"),
        ("get", "/runs/{key}/series"),
        ("get", "/runs/{key}/frames"),
        ("get", "/runs/{key}/flow"),
        ("get", "/runs/{key}/file"),
        ("get", "/runs/{key}/units"),
        ("get", "/unfinished-runs/{key}"),
        ("get", "/unfinished-runs/{key}/series"),
        ("get", "/unfinished-runs/{key}/units"),
        ("get", "/flows"),
        ("get", "/kinds"),
        ("get", "/kinds/{kind}/schema"),
        ("get", "/boundaries"),
        ("get", "/boundaries/{key}"),
        ("get", "/boundaries/{key}/at"),
        ("get", "/boundaries/{key}/file"),
        ("get", "/boundaries/{key}/runs"),
        ("get", "/boundaries/{key}/units"),
        ("get", "/maps"),
        ("get", "/maps/{key}"),
        ("get", "/maps/{key}/file"),
        ("get", "/maps/{key}/units"),
        ("get", "/presets"),
        ("get", "/reports"),
        ("get", "/reports/{name}"),
        ("get", "/metrics"),
        ("get", "/healthz"),
        ("get", "/readyz"),
    }


def test_every_error_is_described_as_a_problem(paths):
    for path, methods in paths.items():
        for method, operation in methods.items():
            for status, response in operation["responses"].items():
                if int(status) >= 400:
                    assert list(response["content"]) == ["application/problem+json"], (path, method, status)


def test_descriptions_are_for_readers_of_the_api(paths):
    """The sections of the docstrings are about Python and stay there."""
    for path, methods in paths.items():
        for method, operation in methods.items():
            assert operation["description"], (path, method)
            assert "---" not in operation["description"], (path, method)


segments = st.sampled_from(sorted({*RUN_FIELDS, *BOUNDARY_FIELDS, "flow", "rate", "0", "kind", "study", "x"}))
conditions = st.builds(
    "{}{}{}".format,
    st.lists(segments | st.integers(0).map(str), min_size=1, max_size=5).map(".".join),
    st.sampled_from(["=", "!=", "<", "<=", ">", ">="]),
    st.text(min_size=1) | st.integers().map(str) | st.floats().map(str) | st.sampled_from(["null", "true"]),
)


@settings(deadline=None, max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(where=st.lists(conditions | st.text(), max_size=3), kind=st.sampled_from(["runs", "boundaries"]))
@example(where=["work.steps=" + "9" * 40], kind="runs")
@example(where=["vesicles." + "9" * 40 + ".angle=1"], kind="runs")
@example(where=["time=1e999"], kind="runs")
@example(where=["name=' OR 1=1 --"], kind="boundaries")
@example(where=["failure=\x00"], kind="runs")
@example(where=["failure=\ud800".encode("utf-8", "surrogatepass").decode("latin-1")], kind="runs")
def test_no_filter_makes_an_error_of_the_server(reading, where, kind):
    response = reading.get(f"/{kind}", params={"where": where})
    assert response.status_code in (200, 422), response.text
