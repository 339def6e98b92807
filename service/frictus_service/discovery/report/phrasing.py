"""What a discovery says, as sentences; page, terminal and API tell the same."""

from frictus_service.discovery.catalogue.cause import NO_UNIT, title
from frictus_service.discovery.document import (
    Discovery,
    Gain,
    NamedCause,
    ParameterEstimate,
    Unexplained,
)


def verdict_sentence(found: Discovery) -> str:
    """Return the answer: what the base model gets wrong, and why.

    Parameters
    ----------
    found : Discovery
        The document of a discovery.
    """
    if found.verdict is None:
        return "Nothing could be tested, so nothing is said of the base model."
    if found.verdict == "clean":
        return "The base model explains these data: nothing that it gets wrong is reproducible."
    if found.verdict == "unexplained":
        return f"The base model is wrong, and no known cause explains it{_where(found)}."
    named = ", ".join(_named(cause) for cause in found.causes)
    unsure = "; ".join(
        f"either {title(a)} or {title(b)}"
        for a, b in (one.between for one in found.cannot_tell)
    )
    what = "; ".join(part for part in (named, unsure) if part)
    if found.verdict == "explained":
        return f"The base model is wrong, and the data say why: {what}. Nothing else is left."
    why = "the data say partly why" if found.causes else "the data leave open why"
    more = f" More is left{_where(found)}." if found.unexplained else ""
    return f"The base model is wrong, and {why}: {what}.{more}"


def _named(cause: NamedCause) -> str:
    shape = "" if cause.verdict == "confirmed" else ", in another shape than the catalogue's"
    return f"{title(cause.id)}{shape}"


def _where(found: Discovery) -> str:
    if not found.unexplained:
        return ""
    strongest = min(found.unexplained, key=lambda one: one.p_value)
    return f", most clearly in {place_of(strongest)}"


def place_of(one: Unexplained) -> str:
    """Return where something unexplained is."""
    low, high = one.band_hz
    where = f"{one.channel}, {low:.4g} to {high:.4g} Hz"
    if one.covariate is None:
        return f"{where}, in all conditions"
    return f"{where}, by {one.covariate}"


def gain_sentence(gain: Gain) -> str:
    """Return by how much data are predicted better that were not used to fit."""
    span = "" if gain.ci95 is None else f" [{gain.ci95[0]:.3g}, {gain.ci95[1]:.3g}]"
    (db, less_db), (deg, less_deg) = gain.residual_db, gain.residual_deg
    return (
        f"Log-likelihood of held-out data {gain.heldout_loglik:+.3g}{span} nats; what is left "
        f"there: {db:.2g} dB and {deg:.2g}° before, {less_db:.2g} dB and {less_deg:.2g}° after."
    )


def shown(estimate: ParameterEstimate) -> str:
    """Return a parameter with interval and unit."""
    value = f"{estimate.value:.4g}"
    if estimate.ci95 is not None:
        value += f" [{estimate.ci95[0]:.4g}, {estimate.ci95[1]:.4g}]"
    return value if estimate.unit == NO_UNIT else f"{value} {estimate.unit}"
