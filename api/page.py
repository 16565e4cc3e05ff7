"""The page: files that ship with the package, and the plotting library that ships with another."""

from __future__ import annotations

from base64 import b64encode
from hashlib import sha256
from importlib.resources import files
from pathlib import Path

from fastapi import FastAPI
from fastapi.responses import FileResponse
from starlette.middleware.gzip import GZipMiddleware
from starlette.staticfiles import StaticFiles

STATIC = Path(str(files("api") / "static"))
PLOTTING = Path(str(files("plotly") / "package_data"))  # holds plotly.min.js

# The plotting library makes one style element without a word in it and fills it by script afterwards.
EMPTY_STYLE = f"'sha256-{b64encode(sha256(b'').digest()).decode()}'"
CONTENT_SECURITY_POLICY = (
    f"default-src 'none'; script-src 'self'; style-src 'self' {EMPTY_STYLE}; img-src 'self' data:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)


def add_page(app: FastAPI) -> None:
    """Serve the page at ``/`` and what it is made of below ``/assets``."""

    @app.get("/", include_in_schema=False)
    async def page() -> FileResponse:
        """Answer with the page."""
        return FileResponse(
            STATIC / "index.html",
            headers={"Content-Security-Policy": CONTENT_SECURITY_POLICY, "Cache-Control": "no-cache"},
        )

    app.mount("/assets/plotly", GZipMiddleware(StaticFiles(directory=PLOTTING)))
    app.mount("/assets", GZipMiddleware(StaticFiles(directory=STATIC)))
