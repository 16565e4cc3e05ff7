"""Imposed flows that a scene may have."""

from __future__ import annotations

from fastapi import APIRouter

from api.http.paging import CollectionPage
from api.results.flow_field import FlowDescription
from api.routes.service import Reader
from solver.flows import FLOWS

router = APIRouter(prefix="/flows", tags=["flows"])


@router.get("")
def list_flows(reader: Reader) -> CollectionPage[FlowDescription]:
    """List the imposed flows, with the names of their parameters.

    Parameters
    ----------
    reader : Caller

    Returns
    -------
    CollectionPage
    """
    return CollectionPage(items=[FlowDescription.of(flow) for flow in FLOWS], next=None)
