"""Protocols of a few short trials, as TOML."""

TRIALS = 12
TOML = """
name = "brief"
description = "A few trials."
[task]
kind = "{task}"
question = "{question}"
[procedure]
{procedure}
[conditions.ridges]
kind = "amplitude"
texture = {{ kind = "spectrum", components = [{{ amplitude_n = 1.0, cycles_per_mm = 1.0 }}] }}
[presentation]
interval_s = {interval_s}
gap_s = {gap_s}
fade_s = 0.05
[design]
practice = {practice}
"""
DETECTION = TOML.format(
    task="2afc",
    question="Which had a texture?",
    procedure=f'kind = "quest+"\nlevels = {{ low = 0.0005, high = 0.08, count = 31 }}\n'
    f"trials = {TRIALS}",
    interval_s=1.0,
    gap_s=0.5,
    practice=1,
)


def brief(task: str, question: str = "Well?", practice: int = 0) -> str:
    """The TOML of three short trials."""
    return TOML.format(
        task=task,
        question=question,
        procedure='kind = "constant"\nlevels = [0.01, 0.02, 0.04]\nrepeats = 1',
        interval_s=0.2,
        gap_s=0.05,
        practice=practice,
    )
