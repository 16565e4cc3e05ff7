"""Lists of branches: the filters and the order of runs, evaluated in a table in memory."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from sqlalchemy import JSON, Column, MetaData, String, Table, create_engine, insert, select

from ensemble.search.branch_summary import BranchSummary
from ensemble.store.filters import conditions, order
from ensemble.store.listing import Listing
from ensemble.store.record_fields import Field, model_fields
from solver.scene import Scene

# The scene is that of the first point.
BRANCH_FIELDS = (
    model_fields(Scene, "scene")
    | {name: field for name, field in model_fields(BranchSummary).items() if name != "scene"}
    | {name: Field((name,), list[dict[str, Any]]) for name in ("branch", "folds", "crossings")}
)

_BRANCHES = Table(
    "branches",
    MetaData(),
    Column("key", String, primary_key=True),
    Column("created", String),
    Column("document", JSON),
)


def listed(summaries: Iterable[BranchSummary], listing: Listing) -> list[dict[str, Any]]:
    """Return those branches that a listing asks for.

    Parameters
    ----------
    summaries : iterable of BranchSummary
    listing : Listing
        Filters and order name fields of the scene or of the branch, as its document has them.

    Returns
    -------
    list of dict
        Their documents, the newest first unless the listing says otherwise.

    Raises
    ------
    StoreInputError
        If a filter or the field to sort by is wrong.
    """
    columns = _BRANCHES.c
    query = select(columns.document).where(*conditions(listing.where, columns.document, BRANCH_FIELDS))
    if listing.sort is not None:
        query = query.order_by(*order(listing.sort, columns.document, BRANCH_FIELDS))
    query = query.order_by(columns.created.desc(), columns.key).limit(listing.limit)
    documents = [summary.document() for summary in summaries]
    engine = create_engine("sqlite://")
    with engine.begin() as connection:
        _BRANCHES.create(connection)
        if documents:
            rows = [{"key": each["key"], "created": each["created"], "document": each} for each in documents]
            connection.execute(insert(_BRANCHES), rows)
        found = [row[0] for row in connection.execute(query)]
    engine.dispose()
    return found
