"""The imposed flows over HTTP."""

from __future__ import annotations

from solver.flows import FLOWS


def test_every_registered_flow_is_described(reading):
    flows = {flow["kind"]: flow for flow in reading.get("/flows").json()["items"]}
    assert list(flows) == [flow(rate=1.0).kind for flow in FLOWS]
    assert flows["shear"] == {
        "kind": "shear",
        "title": "shear flow",
        "parameters": {"rate": {"name": "shear rate", "symbol": "γ̇"}},
    }
