# `uvx --from rust-just just` lists the tasks; `just NAME` does one.

_list:
    @just --list

# style, types and layers: seconds
check:
    uv run ruff check
    uv run ruff format --check
    uv run mypy
    uv run lint-imports

# the default suite, or what is named: `just test tests/clients`
test *WHAT:
    uv run pytest {{ WHAT }}

# the dashboard in a real browser
browser:
    uv run pytest -n 0 -m browser tests/dashboard

# all that must pass before anything lands
ci:
    .ci/run

# analyses and processes of many seconds each: 25 to 40 minutes
long:
    .ci/long

# the documentation, at http://127.0.0.1:8000
docs:
    uv run --group docs mkdocs serve

# figures of this machine, each beside its bare counterpart
bench:
    uv run frictus bench

# lines, files and docstrings of each package
structure:
    uv run python bench/structure.py

# one campaign of attacks, resumable: `just campaign wire --cases 50000`
campaign NAME *OPTIONS:
    uv run python -m tests.campaigns.{{ NAME }} {{ NAME }}.jsonl {{ OPTIONS }}
