"""A kind of question that another distribution adds works everywhere, without a change of these packages."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import tomli_w

from api.client import Client, Refused
from ensemble.config.documents import load_scene
from ensemble.config.run_key import run_key
from ensemble.questions import kind_named, kind_of, kind_of_model, kinds
from ensemble.questions.cost import run_work
from ensemble.store import Store
from tests.api.services import service
from tests.scan_kind import Scan, ScanQuestion

ROOT = Path(__file__).parents[2]
SCENE = load_scene(
    "vesicle-shear",
    ["numerics.points=32", "numerics.tolerance=1e-2", "horizon=1.0"],
)
SCAN = Scan(scene=SCENE, parameter="flow.rate", values=(0.5, 0.75))
OUTCOMES = {"0.5": "undecided", "0.75": "undecided"}


@pytest.fixture
def _installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The distribution that adds the kind, for this process and those that it starts."""
    information = tmp_path / "site" / "scan-1.0.dist-info"
    information.mkdir(parents=True)
    (information / "METADATA").write_text("Metadata-Version: 2.1\nName: scan\nVersion: 1.0\n")
    (information / "entry_points.txt").write_text(
        "[ensemble.questions]\nscan = tests.scan_kind:ScanQuestion\n"
        "[ensemble.commands]\nscan = tests.scan_kind:scan\n"
    )
    site = str(information.parent)
    path = os.pathsep.join(filter(None, [site, str(ROOT), os.environ.get("PYTHONPATH")]))
    monkeypatch.setenv("PYTHONPATH", path)
    monkeypatch.syspath_prepend(site)
    kinds.cache_clear()
    yield
    kinds.cache_clear()


pytestmark = pytest.mark.usefixtures("_installed")


def test_it_is_recognized_and_has_a_key_and_a_cost():
    question = ScanQuestion(SCAN)
    assert kind_named("scan") is kind_of(question.fields) is kind_of_model(SCAN) is ScanQuestion
    assert question.cost.runs == 2
    assert question.cost.work == pytest.approx(2 * run_work(SCENE))
    other = question.changed({"values": [0.5]})
    assert len({question.key, other.key, ScanQuestion.of(question.fields).key}) == 2


def test_the_command_line_answers_it(launcher, tmp_path):
    document, store = tmp_path / "scan.toml", tmp_path / "store"
    document.write_text(tomli_w.dumps(ScanQuestion(SCAN).fields))
    command = [sys.executable, "-m", "ensemble", "scan", str(document), f"--store={store}", "--json"]
    answered = launcher.run(2, [*command, "--progress=json"])
    assert answered.returncode == 0, answered.stderr
    assert json.loads(answered.stdout) == OUTCOMES
    assert all("message" in json.loads(line) for line in answered.stderr.splitlines())
    with Store.existing(store) as opened:
        assert {summary.key for summary in opened.summaries()} == {run_key(scene) for scene in SCAN.scenes()}
    refused = subprocess.run([*command, "--set=values=[]"], capture_output=True, text=True, check=False)
    assert (refused.returncode, refused.stdout) == (2, "")
    assert "values" in refused.stderr
    schema = subprocess.run([*command[:3], "schema", "scan"], capture_output=True, text=True, check=True)
    assert json.loads(schema.stdout)["required"] == ["scene", "parameter", "values"]


@pytest.mark.long
def test_the_service_answers_it(store):
    with service(store, "--workers=1") as started, Client(started.url) as client:
        offered = client.get("/kinds").json()["items"]
        assert [kind["kind"] for kind in offered] == [kind.kind for kind in kinds()]
        assert offered[-1]["title"] == ScanQuestion.title
        assert client.estimate(SCAN).runs == 2
        with pytest.raises(Refused, match=r"values: .* must be at most 8"):
            client.estimate(SCAN, {"values": [0.1 * number for number in range(1, 10)]})
        job = client.wait(client.submit(SCAN))
        assert (job.kind, job.key) == ("scan", ScanQuestion(SCAN).key)
        assert (job.status, job.message) == ("succeeded", "0.5: undecided, 0.75: undecided")
        assert {run.summary.scene.flow.rate for run in client.runs()} == set(SCAN.values)
