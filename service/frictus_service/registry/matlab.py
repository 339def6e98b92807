"""A published model as a MATLAB file."""

import io
import json
from typing import Any

import numpy as np
from scipy.io import savemat

from frictus_service.registry.documents import Published


def to_mat(published: Published) -> bytes:
    """Return a MATLAB 5 file of a published model; `docs/registry.md` has its variables.

    Parameters
    ----------
    published : Published
        Numbers become doubles, texts char arrays; the whole document stands in ``document`` as
        JSON, so that nothing is lost.
    """
    model = published.model
    base = model.base.model_dump(include=set(type(model.base).model_fields) - {"law"})
    covariance = model.covariance
    names = covariance.parameters if covariance is not None else []
    matrix = covariance.matrix if covariance is not None else np.empty((0, 0))
    variables: dict[str, Any] = {
        "schema": model.schema_,
        "name": published.name,
        "version": float(published.version),
        "etag": published.etag,
        "response": model.response,
        "law": model.base.law,
        "parameters": {name: float(value) for name, value in base.items()},
        "hold_s": model.hold_s,
        "skew_s": model.skew_s,
        "validity": {
            name: np.array(getattr(model.validity, name), dtype=np.float64)
            for name in type(model.validity).model_fields
        },
        "covariance": np.asarray(matrix, dtype=np.float64),
        "covariance_parameters": np.array(names, dtype=object),
        "participant": model.participant or "",
        "published_utc": str(np.datetime64(published.published_utc_ns, "ns")) + "Z",
        "provenance": json.dumps(model.provenance),
        "document": model.to_json().decode(),
    }
    content = io.BytesIO()
    savemat(content, variables, long_field_names=True, oned_as="row")  # type: ignore[arg-type]
    return content.getvalue()
