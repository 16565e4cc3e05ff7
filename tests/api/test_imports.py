"""What the server does not load: MPI is the worker's, so a server runs where none is installed.

It costs three seconds.
"""

from __future__ import annotations

from tests.api.processes import run_python

# Opens the application with its routes, submits a job and reads; then nothing of MPI may have been imported.
SERVED = """
import sys
from pathlib import Path
from fastapi.testclient import TestClient
from api.app import create_app
from api.serve import open_service
from api.settings import Settings

sys.modules["mpi4py"] = None  # an import of it is an error, as where it is not installed
with open_service(Settings(store=Path(sys.argv[1]))) as service:
    client = TestClient(create_app(service), base_url="http://127.0.0.1", client=("127.0.0.1", 50000))
    submitted = client.post("/jobs", json={"preset": "doublet-shear", "ranks": 2})
    assert submitted.status_code == 202, submitted.text
    for path in ("/readyz", "/jobs", "/runs", "/boundaries", "/presets", "/metrics", "/openapi.json", "/"):
        assert client.get(path).status_code == 200, path
print(*sorted(name for name in sys.modules if name.startswith("mpi4py.")))
"""


def test_the_server_needs_no_mpi(store):
    result = run_python(SERVED, str(store))
    assert (result.returncode, result.stdout.strip()) == (0, ""), result.stderr
