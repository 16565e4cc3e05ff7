"""The web page at `/`: files that ship with the package, without anything from other sites."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from fastapi import FastAPI
from fastapi.responses import FileResponse
from starlette.middleware.gzip import GZipMiddleware
from starlette.staticfiles import StaticFiles

STATIC = Path(str(files("api") / "static"))

# Scripts and style sheets come from this service only, and nothing is written inline into the page. The one
# exception is the empty style element that Plotly adds and fills by script: its hash is that of no text.
CONTENT_SECURITY_POLICY = "; ".join(
    (
        "default-src 'none'",
        "script-src 'self'",
        "style-src 'self' 'sha256-47DEQpj8HBSa+/TImW+5JCeuQeRkm5NMpJWZG3hSuFU='",
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
    app.mount("/assets", GZipMiddleware(StaticFiles(directory=STATIC)))


async def _get_web_page() -> FileResponse:
    return FileResponse(STATIC / "index.html", headers=WEB_PAGE_HEADERS)
