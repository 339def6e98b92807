"""The reference, `/openapi.json`: made and encoded once, and with what any path may answer."""

from typing import Any, Final

from fastapi import FastAPI, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import JSONResponse, Response
from starlette.routing import Route

from frictus_service.api import problems

_TEMPLATE: Final = "#/components/schemas/{model}"


def install(app: FastAPI) -> None:
    """Serve the reference of `app`, whose routes are complete, in place of FastAPI's own."""
    made: list[bytes] = []

    async def reference(_: Request) -> Response:
        if not made:
            made.append(await run_in_threadpool(_encoded, app))
        return Response(made[0], media_type=JSONResponse.media_type)

    # The first route that matches answers; pages such as /docs name the same path.
    app.router.routes.insert(0, Route(app.openapi_url or "/openapi.json", reference))
    described = app.openapi
    app.openapi = lambda: _with_problems(described())  # type: ignore[method-assign]


def _encoded(app: FastAPI) -> bytes:
    return bytes(JSONResponse(app.openapi()).body)


def _with_problems(page: dict[str, Any]) -> dict[str, Any]:
    """Put the schema of `Problem` in a page, in place of FastAPI's own errors."""
    schemas = page["components"]["schemas"]
    for unused in ("HTTPValidationError", "ValidationError"):
        schemas.pop(unused, None)
    for path in page["paths"].values():
        for operation in path.values():
            kinds = problems.EVERYWHERE + (
                problems.OF_BODIES if "requestBody" in operation else ()
            )
            for status, said in problems.documented(*kinds).items():
                operation["responses"].setdefault(str(status), said)
    problem = problems.Problem.model_json_schema(ref_template=_TEMPLATE)
    schemas.update(problem.pop("$defs"))
    schemas["Problem"] = problem
    return page
