"""Pin every dependency, direct and transitive: `uv run python bench/pin.py`.

Resolves anew and writes the versions into `[tool.uv] constraint-dependencies`. The lock file
names the hosts of package registries, so it stays out of the repository.
"""

import re
import subprocess
from pathlib import Path

PROJECT = Path(__file__).parents[1] / "pyproject.toml"
EXPORT = "uv export --all-extras --all-groups --no-hashes --no-emit-project --no-annotate"


def main() -> None:
    """Rewrite the pins."""
    text = PROJECT.read_text(encoding="utf-8")
    head, _, tail = text.partition("constraint-dependencies = [\n")
    _, _, rest = tail.partition("]\n")
    PROJECT.write_text(head + "constraint-dependencies = [\n]\n" + rest, encoding="utf-8")
    subprocess.run(["uv", "lock", "--upgrade"], check=True)
    exported = subprocess.run(EXPORT.split(), check=True, capture_output=True, text=True).stdout
    pins = [line.strip() for line in exported.splitlines() if re.match(r"[a-z0-9]", line)]
    lines = "".join(f'    "{pin}",\n' for pin in pins)
    PROJECT.write_text(
        head + "constraint-dependencies = [\n" + lines + "]\n" + rest, encoding="utf-8"
    )


if __name__ == "__main__":
    main()
