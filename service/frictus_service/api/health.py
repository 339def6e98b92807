"""Liveness and readiness; both open without a token, for whatever supervises the process."""

from typing import Annotated

from fastapi import APIRouter, Depends
from pydantic import BaseModel, Field

from frictus_service.api import problems
from frictus_service.api.services import Services, services

router = APIRouter(prefix="/v1", tags=["health"])


class Alive(BaseModel):
    """The process answers."""

    alive: bool = True


class Ready(BaseModel):
    """The API can do its work."""

    ready: bool = True
    site: str
    rigs: int
    registry: bool = Field(description="Whether the registry of models can be used")


@router.get("/health")
async def health() -> Alive:  # at once, not behind others who wait for a thread
    """Say that the process answers; nothing else is looked at."""
    return Alive()


@router.get("/ready", responses=problems.documented(problems.NoLinkError))
def ready(given: Annotated[Services, Depends(services)]) -> Ready:
    """Say whether the router is linked; a site without a rig is ready too.

    Rigs are served without the registry: `registry` says whether models can be had.
    """
    return Ready(
        site=given.link.site,
        rigs=len(given.link.names()),
        registry=given.registry.database.usable,
    )
