"""Maps: what becomes of a scene all over two of its parameters."""

from __future__ import annotations

from enum import StrEnum
from http import HTTPStatus
from typing import Annotated

from fastapi import APIRouter, Path, Query, Request, Response
from pydantic import BaseModel

from api.http.caching import NOT_MODIFIED, REVALIDATE, cached_response, etag, json_response
from api.http.paging import After, CollectionPage, Limit, page_response
from api.http.problems import documented
from api.results.downloads import file_response
from api.results.scene_units import SceneUnits
from api.routes.service import Reader
from api.routes.streaming import as_file, stream_file
from ensemble.errors import BadInput
from ensemble.search.map_record import MapRecord
from ensemble.store import Record
from ensemble.timestamp import Timestamp

router = APIRouter(prefix="/maps", tags=["maps"])

MapKey = Annotated[str, Path(pattern="^[0-9a-f]{16}$", description="Key of the map.")]


class MapFile(StrEnum):
    """What a map can be downloaded as; the value is the suffix of the file."""

    PNG = "png"
    SVG = "svg"
    PDF = "pdf"


class ListedMap(BaseModel):
    """A map as a list names it.

    Attributes
    ----------
    key : str
    name : str
    parameters : (str, str)
        Dotted paths of the parameters along its axes.
    label : str
        By which word of a run cells are told apart.
    labels : list of str
        The labels that cells have.
    runs : int
        How many cells were run.
    updated : datetime
        When it was done.
    """

    key: str
    name: str
    parameters: tuple[str, str]
    label: str
    labels: list[str]
    runs: int
    updated: Timestamp

    @classmethod
    def text_of(cls, record: MapRecord) -> str:
        """Return the JSON text that lists a map.

        Parameters
        ----------
        record : MapRecord

        Returns
        -------
        str
        """
        question = record.question  # checked again each time
        first, second = question.axes
        return cls(
            key=record.key,
            name=record.name,
            parameters=(first.parameter, second.parameter),
            label=question.label,
            labels=record.labels,
            runs=len(record.runs),
            updated=record.updated,
        ).model_dump_json()


class MapDocument(MapRecord):
    """A map with the values along its axes.

    Attributes
    ----------
    edges : (list of float, list of float)
        The ends of the cells along each axis: one more than there are cells.
    values : (list of float, list of float)
        The values in the middles of the cells.
    """

    edges: tuple[list[float], list[float]]
    values: tuple[list[float], list[float]]

    @classmethod
    def text_of(cls, record: MapRecord) -> str:
        """Return the JSON text of a map.

        Parameters
        ----------
        record : MapRecord

        Returns
        -------
        str
        """
        axes = record.question.axes
        along = {"edges": [axis.edges for axis in axes], "values": [axis.values for axis in axes]}
        return cls.model_validate(record.model_dump() | along).model_dump_json()


@router.get("", response_model=CollectionPage[ListedMap])
def list_maps(
    request: Request,
    reader: Reader,
    where: Annotated[list[str], Query(include_in_schema=False)] = [],  # noqa: B006  FastAPI copies it
    after: After = None,
    limit: Limit = 100,
) -> Response:
    """List the maps, in the order of their keys.

    Parameters
    ----------
    request : Request
    reader : Caller
    where : list of str
        None, unlike those of runs and boundaries: maps are few.
    after : str or None
        Key of the last item of the previous page.
    limit : int
        Largest number of items.

    Returns
    -------
    Response

    Raises
    ------
    BadInput
        If there are conditions.
    """
    if where:
        raise BadInput(f"where: {where[0]!r} — maps are listed whole, without conditions")
    maps = sorted(reader.service.store.maps(), key=lambda record: record.key)
    following = [record for record in maps if after is None or record.key > after][: limit + 1]
    records = [Record(record.key, ListedMap.text_of(record)) for record in following]
    return page_response(request, records, limit)


@router.get("/{key}", response_model=MapDocument, responses=NOT_MODIFIED | documented(HTTPStatus.NOT_FOUND))
def get_map(request: Request, reader: Reader, key: MapKey) -> Response:
    """Give a map: the label of every cell, and the runs behind it.

    Parameters
    ----------
    request : Request
    reader : Caller
    key : str
        Of the map.

    Returns
    -------
    Response

    Raises
    ------
    NotStored
        If there is no map of this key.
    """
    text = MapDocument.text_of(reader.service.store.map(key))
    return cached_response(request, etag(text), REVALIDATE, lambda: json_response(text))


@router.get("/{key}/units", responses=documented(HTTPStatus.NOT_FOUND))
def get_units_of_map(reader: Reader, key: MapKey) -> SceneUnits:
    """Say how much one is of every number of a map, and of its runs, that has a unit.

    Parameters
    ----------
    reader : Caller
    key : str
        Of the map.

    Returns
    -------
    SceneUnits

    Raises
    ------
    NotStored
        If there is no map of this key.
    """
    record = reader.service.store.map(key)
    return SceneUnits.of(record.scene, (axis.parameter for axis in record.question.axes))


@router.get("/{key}/file", responses=NOT_MODIFIED | documented(HTTPStatus.NOT_FOUND) | file_response(MapFile))
def get_map_file(
    request: Request,
    reader: Reader,
    key: MapKey,
    format: Annotated[MapFile, Query(description="Suffix of the file.")],
) -> Response:
    """Give a map as a figure.

    Parameters
    ----------
    request : Request
    reader : Caller
    key : str
        Of the map.
    format : MapFile

    Returns
    -------
    Response

    Raises
    ------
    NotStored
        If there is no map of this key.
    """
    record = reader.service.store.map(key)
    tag = etag(record.model_dump_json(), "file", format)
    answer = cached_response(request, tag, REVALIDATE, lambda: stream_file(reader, request, key, format))
    return as_file(answer, f"map-{key[:8]}.{format}")
