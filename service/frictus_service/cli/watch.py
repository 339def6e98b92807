"""`frictus watch`: look on, without touching anything."""

import threading
import time

from frictus_service.cli.options import (
    AsJson,
    ConfigFile,
    RigOption,
    RouterOption,
    Seconds,
    SiteOption,
    TargetRig,
    wants_lines,
)

PERIOD_S = 0.1


def watch(
    rig: RigOption = None,
    site: SiteOption = None,
    router: RouterOption = None,
    config: ConfigFile = None,
    seconds: Seconds = None,
    as_json: AsJson = False,
) -> None:
    """Show finger, status, loop health, blocks and gaps of a rig as they come."""
    import frictus
    from frictus_service.cli.felt import Observer
    from frictus_service.cli.screen import Display

    target = TargetRig.of(config, router, site, rig)
    with frictus.connect(target.router, tls=target.tls, reads_only=True) as client:
        found = target.choose(client)
        observer = Observer(found)
        with Display(f"rig {found.name} at {found.site}", wants_lines(as_json)) as display:
            never = threading.Event()
            begun_s = due_s = time.monotonic()
            while seconds is None or due_s - begun_s < seconds:
                due_s = max(due_s + PERIOD_S, time.monotonic())
                never.wait(due_s - time.monotonic())
                display.show(observer.look(), time.monotonic() - begun_s)
