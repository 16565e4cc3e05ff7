"""The web page at `/`: files that ship with this package and with Plotly's, and nothing from other sites."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from fastapi import FastAPI
from fastapi.responses import FileResponse
from starlette.middleware.gzip import GZipMiddleware
from starlette.staticfiles import StaticFiles

STATIC = Path(str(files("api") / "static"))

PLOTTING = Path(str(files("plotly") / "package_data"))

# Scripts, style sheets and data come from this service only.  Plotly adds style elements of its own (one that
# it fills by script, one for maps), whose text changes with its version, so inline styles are allowed; they
# cannot run code.
CONTENT_SECURITY_POLICY = "; ".join(
    (
        "default-src 'none'",
        "script-src 'self'",
        "style-src 'self' 'unsafe-inline'",
        "img-src 'self' data:",
        "connect-src 'self'",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
    )
)


WEB_PAGE_HEADERS = {"Content-Security-Policy": CONTENT_SECURITY_POLICY, "Cache-Control": "no-cache"}


def add_web_page(app: FastAPI) -> None:
    """Serve the page at ``/`` and its files below ``/assets``.

    Parameters
    ----------
    app : FastAPI
    """
    app.add_api_route("/", _get_web_page, include_in_schema=False)
    app.mount("/assets/plotly", GZipMiddleware(StaticFiles(directory=PLOTTING)))
    app.mount("/assets", GZipMiddleware(StaticFiles(directory=STATIC)))


async def _get_web_page() -> FileResponse:
    return FileResponse(STATIC / "index.html", headers=WEB_PAGE_HEADERS)
