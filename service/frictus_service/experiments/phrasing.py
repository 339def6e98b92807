"""What the trials of a condition say, in words."""

from frictus.experiment import ConditionResult


def result_lines(result: ConditionResult) -> list[str]:
    """Return what to say of a condition.

    Parameters
    ----------
    result : ConditionResult
        Of its trials.
    """
    lines = [f"{result.condition}: {result.trials} trials"]
    if result.refused:
        lines.append(f"  {result.refused} not presented: the rig could not render them whole")
    if result.flagged:
        lines.append(
            f"  {result.flagged} with a flag, such as scaled or extrapolated: see the log"
        )
    if result.not_felt:
        lines.append(
            f"  {result.not_felt} not counted: the finger did not touch, or did not move"
        )
    if result.limited:
        lines.append(
            f"  {result.limited} set to the end of what can be set or rendered, more wanted: "
            "the mean is a bound, not the setting"
        )
    if result.catch_right is not None:
        lines.append(
            f"  catch trials: {result.catch_right[0]} of {result.catch_right[1]} right"
        )
    if (fit := result.fit) is not None:
        for name, value in (("threshold", fit.threshold), ("by likelihood", fit.threshold_ml)):
            lines.append(
                f"  {name}: {value.value:.3g} {result.unit} "
                f"(95 %: {value.low:.3g} to {value.high:.3g})"
            )
        lines.append(f"  slope {fit.slope.value:.2g}, lapses {100.0 * fit.lapse:.1f} %")
        if fit.open_ended:
            lines.append("  the trials do not bound the threshold: use other levels, or more")
    estimates = (("exponent", result.exponent, ""), ("setting", result.setting, result.unit))
    for name, found, unit in estimates:
        if found is not None:
            told = f"  {name}: {found.value:.3g} {unit}".rstrip()
            lines.append(f"{told} (95 %: {found.low:.3g} to {found.high:.3g})")
    ratings = result.ratings or {}
    lines += [f"  {pair.replace('|', ' and ')}: {mean:.3g}" for pair, mean in ratings.items()]
    return lines
