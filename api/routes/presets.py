"""Studies and scenes that ship with the package."""

from __future__ import annotations

from fastapi import APIRouter
from pydantic import TypeAdapter

from api.auth.callers import Reader
from api.http.schemas import Page, Preset
from api.jobs.cost_estimate import estimate
from api.jobs.job import preset_work
from ensemble.config.documents import preset_document, preset_names
from solver.scene.arrangement import Arrangement

router = APIRouter(prefix="/presets", tags=["presets"])


@router.get("")
def list_presets(reader: Reader) -> Page[Preset]:
    """List the presets, in full and with what they may cost."""
    return Page(
        items=[_preset(name, reader.service.settings.maximum_cost) for name in preset_names()], next=None
    )


def _preset(name: str, maximum_cost: float) -> Preset:
    work = preset_work(name, {})
    document = work.document
    arrangement = preset_document(name).get("arrangement")
    if arrangement is not None:  # a few lines that one may change, instead of the vesicles that come of them
        in_full = TypeAdapter(Arrangement).dump_python(
            TypeAdapter(Arrangement).validate_python(arrangement), mode="json", exclude_none=True
        )
        document = {key: value for key, value in document.items() if key != "vesicles"}
        document["arrangement"] = in_full
    return Preset(name=name, kind=work.kind, document=document, estimate=estimate(work.model, maximum_cost))
