"""Keys of studies and maps: equal questions share a key, so an answer takes the place of the earlier one."""

from __future__ import annotations

import hashlib
import json
from typing import Final

from solver.scene import Model

QUESTION_KEY_DIGITS: Final = 16  # hexadecimal


def question_key(question: Model) -> str:
    """Return the key of a question about a scene.

    Parameters
    ----------
    question : Model
        With the field ``scene``, whose units do not count.

    Returns
    -------
    str
        16 hexadecimal digits of the SHA-256 of its canonical JSON (sorted keys).
    """
    document = question.model_dump(mode="json", exclude={"scene": {"units"}})
    canonical = json.dumps(document, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(canonical.encode()).hexdigest()[:QUESTION_KEY_DIGITS]
