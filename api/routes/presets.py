"""Studies and scenes that ship with the package."""

from __future__ import annotations

from fastapi import APIRouter

from api.auth import Reader
from api.cost import estimate
from api.job import preset_work
from api.schemas import Page, Preset
from ensemble.study import preset_names

router = APIRouter(prefix="/presets", tags=["presets"])


@router.get("")
def list_presets(reader: Reader) -> Page[Preset]:
    """List the presets, in full and with what they may cost."""
    return Page(
        items=[_preset(name, reader.service.settings.maximum_cost) for name in preset_names()], next=None
    )


def _preset(name: str, maximum_cost: float) -> Preset:
    work = preset_work(name, {})
    return Preset(
        name=name, kind=work.kind, document=work.document, estimate=estimate(work.model, maximum_cost)
    )
