"""How often runs in progress are kept: the setting `ENSEMBLE_CHECKPOINT_SECONDS`."""

from __future__ import annotations

import os
from collections.abc import Mapping

from ensemble.errors import BadInput

CHECKPOINT_SECONDS = "ENSEMBLE_CHECKPOINT_SECONDS"
DEFAULT_SECONDS = 60.0
MOST_SECONDS = 86400.0


def checkpoint_seconds(environment: Mapping[str, str] = os.environ) -> float:
    """Return after how many seconds of wall time the next checkpoint of a run is written.

    Parameters
    ----------
    environment : mapping
        Environment variables.

    Returns
    -------
    float

    Raises
    ------
    BadInput
        If the variable is no number of seconds that is allowed.
    """
    text = environment.get(CHECKPOINT_SECONDS, str(DEFAULT_SECONDS))
    try:
        seconds = float(text)
    except ValueError:
        seconds = 0.0
    if not 0 < seconds <= MOST_SECONDS:
        raise BadInput(
            f"{CHECKPOINT_SECONDS}: {text!r} — must be a number of seconds above 0 and up to {MOST_SECONDS:g}"
        )
    return seconds
