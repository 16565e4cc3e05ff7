"""Jobs that are accepted at once, as most tests want them."""

from __future__ import annotations

from typing import Any

from api.jobs.job_queue import Jobs, Submitted


def accepted(jobs: Jobs, *offer: Any, **fields: Any) -> Submitted:
    """What became of an offer, whose parameters these are."""
    return jobs.settled(jobs.offer(*offer, **fields))
