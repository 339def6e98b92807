"""The reference, `/openapi.json`: made and encoded once.

What any path may answer is added, and what `parse_json` demands of bodies.
"""

import asyncio
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
    making = asyncio.Lock()

    async def reference(_: Request) -> Response:
        async with making:
            if not made:
                made.append(await run_in_threadpool(_encoded, app))
        return Response(made[0], media_type=JSONResponse.media_type)

    # The first route that matches answers; pages such as /docs name the same path.
    app.router.routes.insert(0, Route(app.openapi_url or "/openapi.json", reference))
    described = app.openapi
    app.openapi = lambda: _completed(described())  # type: ignore[method-assign]


def _encoded(app: FastAPI) -> bytes:
    return bytes(JSONResponse(app.openapi()).body)


def _completed(page: dict[str, Any]) -> dict[str, Any]:
    """Complete a page; the schema of `Problem` comes in place of FastAPI's own errors."""
    schemas = page["components"]["schemas"]
    for unused in ("HTTPValidationError", "ValidationError"):
        schemas.pop(unused, None)
    operations = [operation for path in page["paths"].values() for operation in path.values()]
    for operation in operations:
        for parameter in operation.get("parameters", ()):
            _without_null(parameter["schema"])
        kinds = problems.EVERYWHERE + (problems.OF_BODIES if "requestBody" in operation else ())
        for status, said in problems.documented(*kinds).items():
            operation["responses"].setdefault(str(status), said)
    _make_strict([operation.get("requestBody") for operation in operations], schemas)
    problem = problems.Problem.model_json_schema(ref_template=_TEMPLATE)
    schemas.update(problem.pop("$defs"))
    schemas["Problem"] = problem
    return page


def _without_null(parameter: dict[str, Any]) -> None:
    """Take null from what a parameter may be: one that has no value is left out."""
    kinds = [kind for kind in parameter.get("anyOf", ()) if kind != {"type": "null"}]
    if len(kinds) == 1:
        del parameter["anyOf"]
        parameter.update(kinds[0])


def _make_strict(bodies: list[Any], schemas: dict[str, Any]) -> None:
    """State what is demanded of bodies: known fields only, and the tag of each alternative.

    A type that carries unknown fields on says so itself.
    """
    waiting, seen = bodies, set[int]()
    while waiting:
        part = waiting.pop()
        if isinstance(part, list):
            waiting.extend(part)
        elif isinstance(part, dict) and id(part) not in seen:
            seen.add(id(part))
            waiting.extend(part.values())
            if "$ref" in part:
                waiting.append(_referred(part, schemas))
            if "properties" in part:
                part.setdefault("additionalProperties", False)
            if "discriminator" in part:
                tag = part["discriminator"]["propertyName"]
                for alternative in part["oneOf"]:
                    required = _referred(alternative, schemas).setdefault("required", [])
                    required += [tag] * (tag not in required)


def _referred(part: dict[str, Any], schemas: dict[str, Any]) -> Any:
    return schemas[part["$ref"].rpartition("/")[2]]
