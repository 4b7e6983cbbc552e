"""The small print under figures and tables: scale, and how good the chains are."""


def scale_line(settings: dict, *more: str) -> str:
    """'Scale quick, seed 1; ...' from a rule's settings."""
    return "; ".join([f"Scale {settings['scale']['name']}, seed {settings['seed']}", *more])


def chain_line(samples: int, verdict: dict) -> str:
    """How the chains of one T ran and how far they got, from `posterior/*.json`.

    R-hat and ESS are the largest and the smallest over all coordinates.
    """
    acceptance = "/".join(f"{share:.2f}" for share in verdict["acceptance"])
    return (
        f"T={samples}: N={verdict['draws_per_sample']}, "
        f"σq={1e6 * verdict['step_length_m']:.3g} µm, {verdict['steps']} steps, "
        f"acc. {acceptance}, R-hat {verdict['rhat_max']:.3f}, "
        f"ESS {verdict['ess_min']:.0f}"
    )


def chain_lines(verdicts: dict[int, dict]) -> list[str]:
    """One line per T; the last says what R-hat is and which chains pass its criterion.

    Only a verdict that says so is called converged.
    """
    lines = [chain_line(samples, verdict) for samples, verdict in verdicts.items()]
    good = [str(samples) for samples, verdict in verdicts.items() if verdict["converged"]]
    bad = [str(samples) for samples, verdict in verdicts.items() if not verdict["converged"]]
    threshold = max(verdict["rhat_threshold"] for verdict in verdicts.values())
    last = "R-hat: the largest, ESS: the smallest over all coordinates."
    if good:
        last += f" R-hat < {threshold:g}, converged: T = {', '.join(good)}."
    if bad:
        last += f" R-hat not below {threshold:g}, preliminary: T = {', '.join(bad)}."
    return [*lines, last]


def unfinished(table, threshold: float) -> list[str]:
    """A note on the rows whose chains fail the criterion; none if there are no such rows."""
    failed = (~table.converged).sum()
    if not failed:
        return []
    return [f"R-hat is not below {threshold:g} in {failed} of {len(table)} rows: preliminary."]
