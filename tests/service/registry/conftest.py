"""A registry on each database: a SQLite file, and a private PostgreSQL server."""

import contextlib
import itertools
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import create_engine, text
from tests.service.registry.postgresql import NoServerError, server

from frictus.model import Covariance, FirstOrderSpeedLaw, Model
from frictus_service.registry.store import Registry

_NUMBER = itertools.count()


@pytest.fixture(scope="session")
def postgresql() -> Iterator[Callable[[], str]]:
    """Make an empty schema on a real server, and return the URL that leads to it."""
    with contextlib.ExitStack() as undo:
        try:
            root = undo.enter_context(server())
        except NoServerError as error:
            pytest.skip(f"no PostgreSQL here: {error}")
        engine = create_engine(f"{root}postgres", isolation_level="AUTOCOMMIT")
        undo.callback(engine.dispose)

        def make() -> str:
            name = f"test{next(_NUMBER)}"
            with engine.connect() as connection:
                connection.execute(text(f"CREATE SCHEMA {name}"))
            return f"{root}postgres?options=-csearch_path%3D{name}"

        yield make


@pytest.fixture(params=["sqlite", "postgresql"])
def url(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """A database of each kind, empty."""
    if request.param == "sqlite":
        return f"sqlite:///{tmp_path / 'registry.db'}"
    make: Callable[[], str] = request.getfixturevalue("postgresql")
    return make()


@pytest.fixture
def registry(url: str) -> Iterator[Registry]:
    with Registry(url) as opened:
        yield opened


MakeModel = Callable[..., Model]


@pytest.fixture
def model() -> MakeModel:
    """Make a model as identification would."""

    def make(gain_n: float = 0.4, participant: str | None = "P01", **changes: Any) -> Model:
        fields: dict[str, Any] = {
            "base": FirstOrderSpeedLaw(
                gain_n=gain_n, cutoff_0_hz=400.0, slope_hz_per_mm_s=12.0
            ),
            "participant": participant,
            "covariance": Covariance(
                parameters=["gain_n", "cutoff_0_hz", "slope_hz_per_mm_s"],
                matrix=[[1e-4, 0.0, 0.0], [0.0, 25.0, -0.3], [0.0, -0.3, 0.01]],
            ),
            "provenance": {
                "study_sha256": "0123456789abcdef" * 4,
                "code_version": "0.1.0",
                "settings": {"delay": True},
                "seed": 7,
            },
        }
        return Model(**(fields | changes))

    return make
