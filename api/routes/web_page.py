"""The web page at `/`: files that ship with this package and with Plotly's, and nothing from other sites."""

from __future__ import annotations

import gzip
import hashlib
from functools import cache
from http import HTTPStatus
from importlib.metadata import version
from importlib.resources import files
from mimetypes import guess_type
from pathlib import Path

from fastapi import FastAPI, Request, Response
from fastapi.responses import FileResponse
from starlette.exceptions import HTTPException

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
        "frame-src blob:",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
    )
)


WEB_PAGE_HEADERS = {"Content-Security-Policy": CONTENT_SECURITY_POLICY, "Cache-Control": "no-cache"}
# The address of an asset contains a digest of all assets, so what is at an address never changes.
ASSET_HEADERS = {"Cache-Control": "public, max-age=31536000, immutable", "Vary": "Accept-Encoding"}
ASSETS = {str(path.relative_to(STATIC)): path for path in STATIC.rglob("*") if path.is_file()}
PAGE = ASSETS.pop("index.html")
ASSETS["plotly/plotly.min.js"] = PLOTTING / "plotly.min.js"


def add_web_page(app: FastAPI) -> None:
    """Serve the page at ``/`` and its files below ``/assets``.

    Parameters
    ----------
    app : FastAPI
    """
    app.add_api_route("/", _get_web_page, include_in_schema=False)
    app.add_api_route("/assets/{name:path}", _get_asset, include_in_schema=False)


async def _get_web_page() -> Response:
    return Response(_web_page(), media_type="text/html", headers=WEB_PAGE_HEADERS)


@cache
def _web_page() -> str:
    return PAGE.read_text(encoding="utf-8").replace('"assets/', f'"assets/{assets_digest()}/')


def _get_asset(request: Request, name: str) -> Response:
    path = ASSETS.get(name.removeprefix(f"{assets_digest()}/"))
    if path is None or not name.startswith(assets_digest()):
        raise HTTPException(HTTPStatus.NOT_FOUND, "there is no such asset")
    media_type = guess_type(path)[0]
    if "gzip" not in request.headers.get("accept-encoding", ""):
        return FileResponse(path, headers=ASSET_HEADERS, media_type=media_type)
    return Response(
        _compressed(path), media_type=media_type, headers=ASSET_HEADERS | {"Content-Encoding": "gzip"}
    )


@cache
def assets_digest() -> str:
    """Return a digest of the assets, which are Plotly of the installed version and files of this package.

    Returns
    -------
    str
    """
    digest = hashlib.sha256(version("plotly").encode())
    for name in sorted(ASSETS.keys() - {"plotly/plotly.min.js"}):
        digest.update(f"{name}\0".encode() + ASSETS[name].read_bytes())
    return digest.hexdigest()[:16]


@cache
def _compressed(path: Path) -> bytes:
    """Return an asset compressed; each is compressed once, whoever asks for it how often."""
    return gzip.compress(path.read_bytes(), mtime=0)
