"""Ask the REST API what its rigs do, with nothing but the standard library.

The argument is the API's address, `http://127.0.0.1:8420` unless given.
"""

import json
import sys
from typing import Any
from urllib.request import urlopen

API = sys.argv[1] if len(sys.argv) > 1 else "http://127.0.0.1:8420"


def get(path: str) -> Any:
    """Return the JSON at a path."""
    with urlopen(API + path, timeout=10.0) as reply:
        return json.load(reply)


for name in get("/v1/rigs")["rigs"]:
    status, model = get(f"/v1/rigs/{name}"), get(f"/v1/rigs/{name}/model")
    stands_in = " (a placeholder)" if model["placeholder"] else ""
    print(f"{name}: {status['state']}, {status['sample_rate_hz']:g} Hz")
    print(f"  gain of its model {model['base']['gain_n']:.3f} N{stands_in}")
