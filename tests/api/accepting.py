"""Submits jobs and waits until they are accepted, as most tests do."""

from __future__ import annotations

from typing import Any

from api.jobs.job_queue import Jobs, SubmissionResult


def accepted(jobs: Jobs, *submission: Any, **options: Any) -> SubmissionResult:
    """The result of a submission, with arguments as `Jobs.submit` takes them."""
    return jobs.result(jobs.submit(*submission, **options))
