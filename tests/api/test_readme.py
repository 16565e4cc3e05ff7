"""`api/README.md` is true: its requests, its Python and its table of settings."""

from __future__ import annotations

import json
import os
import re
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx2
import pytest

from api.settings import Settings
from tests.api.processes import working
from tests.api.servers import client_of, serving
from tests.api.stores import RATES, fill

README = (Path(__file__).parents[2] / "api" / "README.md").read_text(encoding="utf-8")
ADDRESS = "http://127.0.0.1:8000"
SECONDS = 280  # for a job that compiles its kernels first, on a busy machine

# What every curl of the examples does in addition: fail if the answer is an error, and print nothing else.
CURL_CONFIGURATION = f"""
silent
show-error
fail-with-body
max-time = {SECONDS}
"""
CURL_HTTP_ERROR = 22


@dataclass(frozen=True)
class Block:
    """A fenced block of the README."""

    language: str
    text: str


def section(title: str) -> str:
    """Return a section of the README, with its subsections."""
    (_, rest) = re.split(rf"^## {re.escape(title)}$", README, flags=re.MULTILINE)
    return re.split(r"^## ", rest, flags=re.MULTILINE)[0]


def blocks(text: str) -> list[Block]:
    """Return the fenced blocks of a text."""
    return [Block(*found) for found in re.findall(r"^```(\w+)\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)]


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Address of a service with runs, a boundary and a worker."""
    store = fill(tmp_path_factory.mktemp("readme") / "store")
    with serving(store) as url, working(store):
        yield url


def run_shell(script: str, directory: Path, variables: dict[str, str]) -> subprocess.CompletedProcess[str]:
    """Run a block of the README in which curl fails on errors."""
    return subprocess.run(
        ["bash", "-euo", "pipefail", "-c", script],
        env=os.environ | variables | {"CURL_HOME": str(directory)},
        cwd=directory,
        capture_output=True,
        text=True,
        timeout=SECONDS,
    )


def last_document(output: str) -> Any:
    """Return the last of several JSON documents that follow each other."""
    documents, decoder = [], json.JSONDecoder()
    while output := output.strip():
        document, end = decoder.raw_decode(output)
        documents.append(document)
        output = output[end:]
    return documents[-1]


def assert_same_fields(documented: Any, actual: Any, path: str = "") -> None:
    """Check that two JSON documents have the same fields; numbers and texts may differ."""
    if isinstance(documented, dict):
        assert isinstance(actual, dict), path
        assert documented.keys() == actual.keys(), path
        for name in documented:
            assert_same_fields(documented[name], actual[name], f"{path}.{name}")
    elif isinstance(documented, list):
        assert isinstance(actual, list), path
        for index, item in enumerate(documented):
            assert_same_fields(item, actual[index], f"{path}.{index}")
    else:
        assert type(documented) is type(actual), path


def test_the_requests_get_the_documented_answers(address: str, tmp_path: Path) -> None:
    (tmp_path / ".curlrc").write_text(CURL_CONFIGURATION, encoding="utf-8")
    (boundary,) = httpx2.get(f"{address}/boundaries").json()["items"]
    first, *rest = blocks(section("REST by example"))
    assert first.text.strip() == f"SERVICE={ADDRESS}"
    variables = {"SERVICE": address, "STUDY": boundary["study_key"]}
    output, checked = "", 0
    for block, following in zip(rest, [*rest[1:], None], strict=True):
        documented = json.loads(following.text) if following and following.language == "json" else {}
        if block.language == "json":
            answer = last_document(output)
            assert_same_fields(json.loads(block.text), answer)
            if "attempts" in answer:
                variables |= {"JOB": answer["id"], "RUN": answer["key"]}
            checked += 1
            continue
        assert block.language == "sh"
        is_error = isinstance(documented.get("status"), int) and documented["status"] >= 400
        result = run_shell(block.text, tmp_path, variables)
        assert result.returncode == (CURL_HTTP_ERROR if is_error else 0), block.text + result.stderr
        output = result.stdout
        if is_error:
            assert last_document(output) == documented
            checked += 1
    assert checked >= 5
    job = httpx2.get(f"{address}/jobs/{variables['JOB']}").json()
    assert job["status"] == "succeeded"
    run = httpx2.get(f"{address}/runs/{variables['RUN']}").json()
    points = 1 + 3 * len(run["scene"]["vesicles"]) * run["work"]["points"]
    assert (tmp_path / "frames.f32").stat().st_size % (4 * points) == 0


def test_the_python_runs(address: str, capsys: pytest.CaptureFixture[str]) -> None:
    (block,) = blocks(section("From Python"))
    exec(compile(block.text.replace(ADDRESS, address), "README.md", "exec"), {})
    printed = capsys.readouterr().out
    assert "succeeded 100" in printed
    assert "undecided" in printed
    assert "critical-hamaker" in printed


def test_a_route_is_added_as_described(filled_store: Path) -> None:
    *_, block = blocks(section("The folders"))
    module: dict[str, Any] = {"__name__": "added_route"}
    exec(compile(block.text, "README.md", "exec"), module)
    with client_of(filled_store, routers=[module["router"]]) as client:
        bound = client.get("/outcomes/bound")
        assert bound.json() == {"outcome": "bound", "runs": sum(rate >= 0.75 for rate in RATES)}
        assert bound.headers["x-content-type-options"] == "nosniff"
        refused = client.get("/outcomes/lost")
        assert refused.status_code == 422
        assert "outcome" in refused.json()["detail"]


OF_THE_MACHINE = {"maximum_ranks": "number of processors", "maximum_memory": "that of the machine"}


def settings_table() -> list[str]:
    """Return the rows of the table of settings."""
    rows = []
    for name, field in Settings.model_fields.items():
        if name == "store":  # an option of the commands
            continue
        default = OF_THE_MACHINE[name] if field.default_factory else _written(field.default)
        rows.append(f"| `ENSEMBLE_{name.upper()}` | {default} | {field.description} |")
    return rows


def _written(default: Any) -> str:
    if default is None:
        return "files in the store"
    if default == "":
        return "none"
    return (
        f"{default:g}" if isinstance(default, float) and default >= 1e6 else f"{default}".removesuffix(".0")
    )


def test_the_table_of_settings_is_complete() -> None:
    table = [line for line in README.splitlines() if line.startswith("| `ENSEMBLE_")]
    assert table == settings_table(), "\n".join(settings_table())
