"""The document of a discovery where nothing could be tested."""

from importlib.metadata import version

from frictus.model import Model
from frictus_service.discovery.catalogue.causes import CAUSES
from frictus_service.discovery.document import CauseTest, Discovery, StudyFacts


def nothing_tested(
    study: StudyFacts, base: Model, seed: int, notes: tuple[str, ...]
) -> Discovery:
    """Return the document where nothing could be tested."""
    return Discovery(
        code_version=version("frictus"),
        seed=seed,
        study=study,
        response=base.response,
        base_model=base,
        extended_model=base,
        verdict=None,
        causes=(),
        cannot_tell=(),
        unexplained=(),
        explained_share=None,
        gain=None,
        tests=tuple(
            CauseTest(id=name, not_tested="too few participants and trials")
            for name, cause in CAUSES.items()
            if cause.response in (base.response, "both")
        ),
        notes=notes,
    )
