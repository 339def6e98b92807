"""The router, and the rigs behind it."""

from collections.abc import Iterator
from typing import Final

import frictus
from frictus.errors import CertificateError, LinkError
from frictus_service.cli.checks.check import Check
from frictus_service.config import SecurityConfig
from frictus_service.errors import ConfigurationError

ANSWER_S: Final = 1.0


def router_and_rigs(endpoint: str, security: SecurityConfig | None = None) -> Iterator[Check]:
    """Look for the router, and for rigs behind it."""
    try:
        tls = None if security is None else security.of("client")
        with frictus.connect(endpoint, timeout_s=ANSWER_S, tls=tls) as client:
            yield Check("router", "ok", f"answers at {endpoint}")
            rigs = client.rigs()
            for rig in rigs:
                yield _rig(client, rig)
    except (CertificateError, ConfigurationError) as error:
        yield Check("router", "fail", str(error), "see docs/security.md")
        return
    except LinkError as error:
        yield Check("router", "warn", str(error), "start `frictus serve`, or name its --router")
        return
    if not rigs:
        to_do = "start `frictus serve` or `frictus rig`"
        yield Check("rigs", "warn", "none is present", to_do)


def _rig(client: frictus.Client, which: frictus.RigName) -> Check:
    name = f"rig {which.name} at {which.site}"
    try:
        status = client.rig(which.name, which.site).status()
    except (frictus.FrictusError, OSError) as error:
        return Check(name, "fail", str(error), "look at the output of its `frictus serve`")
    found = f"{status.state}, {status.backend}, version {status.version}"
    if status.fault is not None:
        return Check(name, "fail", f"{found}: {status.fault.reason}", status.fault.action)
    if status.model_placeholder:
        to_do = "measure and set a model; until then friction is not true to scale"
        return Check(name, "warn", f"{found}, with a placeholder model", to_do)
    return Check(name, "ok", found)
