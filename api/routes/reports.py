"""Reports that have been made into the store: on the solver, and the paper recomputed."""

from __future__ import annotations

from datetime import UTC, datetime
from http import HTTPStatus
from pathlib import Path

from fastapi import APIRouter
from fastapi.responses import HTMLResponse
from pydantic import BaseModel
from starlette.exceptions import HTTPException

from api.http.caching import REVALIDATE
from api.http.paging import CollectionPage
from api.http.problems import documented
from api.routes.service import Reader
from ensemble.report import PAGE, ReportName, report_directory

router = APIRouter(prefix="/reports", tags=["reports"])

# A report holds its style and its images; nothing in it runs or is loaded.
_HEADERS = {
    "Cache-Control": REVALIDATE,
    "Content-Security-Policy": "sandbox; default-src 'none'; style-src 'unsafe-inline'; img-src data:",
}


class ReportDocument(BaseModel):
    """A report that has been made.

    Attributes
    ----------
    name : ReportName
    updated : datetime
        When it was made last.
    """

    name: ReportName
    updated: datetime


@router.get("")
def list_reports(reader: Reader) -> CollectionPage[ReportDocument]:
    """List the reports that have been made.

    Parameters
    ----------
    reader : Caller

    Returns
    -------
    CollectionPage
    """
    pages = {name: _page(reader, name) for name in ReportName}
    made = [
        ReportDocument(name=name, updated=datetime.fromtimestamp(page.stat().st_mtime, UTC))
        for name, page in pages.items()
        if page.exists()
    ]
    return CollectionPage(items=made, next=None)


@router.get("/{name}", response_class=HTMLResponse, responses=documented(HTTPStatus.NOT_FOUND))
def get_report(reader: Reader, name: ReportName) -> HTMLResponse:
    """Give a report as an HTML page that needs no other file.

    Parameters
    ----------
    reader : Caller
    name : ReportName

    Returns
    -------
    HTMLResponse
    """
    page = _page(reader, name)
    if not page.exists():
        raise HTTPException(HTTPStatus.NOT_FOUND, f"nobody has made the report {name} into this store")
    return HTMLResponse(page.read_text(encoding="utf-8"), headers=_HEADERS)


def _page(reader: Reader, name: ReportName) -> Path:
    return report_directory(reader.service.store.path, name) / PAGE
