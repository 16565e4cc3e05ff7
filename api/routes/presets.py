"""Studies and scenes that ship with the package."""

from __future__ import annotations

from fastapi import APIRouter
from pydantic import TypeAdapter

from api.http.paging import CollectionPage
from api.jobs.submissions import PresetDocument, estimate, job_limits, usual_ranks
from api.routes.service import Reader, Service
from ensemble.config.documents import preset_document, preset_names
from ensemble.questions import preset_question
from solver.scene.arrangement import Arrangement

router = APIRouter(prefix="/presets", tags=["presets"])


@router.get("")
def list_presets(reader: Reader) -> CollectionPage[PresetDocument]:
    """List the presets, with all fields and with the largest cost of each.

    Parameters
    ----------
    reader : Caller

    Returns
    -------
    CollectionPage
    """
    return CollectionPage(items=[_preset(name, reader.service) for name in preset_names()], next=None)


def _preset(name: str, service: Service) -> PresetDocument:
    question = preset_question(name, {})
    document = question.fields
    arrangement = preset_document(name).get("arrangement")
    if arrangement is not None:  # its few fields are easier to change than the vesicles made from it
        complete = TypeAdapter(Arrangement).dump_python(
            TypeAdapter(Arrangement).validate_python(arrangement), mode="json", exclude_none=True
        )
        document = {key: value for key, value in document.items() if key != "vesicles"}
        document["arrangement"] = complete
    cost = estimate(question, job_limits(service.settings))
    ranks = usual_ranks(question, cost, service.settings)
    return PresetDocument(
        name=name,
        kind=question.kind,
        document=document,
        estimate=service.expected_times.added(cost, question, ranks),
    )
