"""The page: files that ship with the package, and the plotting library that ships with another."""

from __future__ import annotations

import re
from base64 import b64encode
from hashlib import sha256
from importlib.resources import files
from pathlib import Path

from fastapi import FastAPI
from fastapi.responses import FileResponse
from starlette.middleware.gzip import GZipMiddleware
from starlette.staticfiles import StaticFiles

STATIC = Path(str(files("api") / "static"))
PLOTTING = Path(str(files("plotly") / "package_data"))


def add_page(app: FastAPI) -> None:
    """Serve the page at ``/`` and what it is made of below ``/assets``."""
    headers = {"Content-Security-Policy": _content_security_policy(), "Cache-Control": "no-cache"}

    @app.get("/", include_in_schema=False)
    async def page() -> FileResponse:
        """Answer with the page."""
        return FileResponse(STATIC / "index.html", headers=headers)

    app.mount("/assets/plotly", GZipMiddleware(StaticFiles(directory=PLOTTING)))
    app.mount("/assets", GZipMiddleware(StaticFiles(directory=STATIC)))


def _content_security_policy() -> str:
    # The plotting library makes two style elements: an empty one, which it fills by script, and one for maps.
    script = (PLOTTING / "plotly.min.js").read_text(encoding="utf-8")
    styles = ["", *re.findall(r"\.textContent='([^'\\]+)'", script)]
    allowed = " ".join(f"'sha256-{b64encode(sha256(style.encode()).digest()).decode()}'" for style in styles)
    return (
        f"default-src 'none'; script-src 'self'; style-src 'self' {allowed}; img-src 'self' data:; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )
