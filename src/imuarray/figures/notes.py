"""The small print under figures and tables: scale, and how good the chains are."""

from __future__ import annotations

SOURCES = {
    "standin": "simulated stand-in; measured data: not yet",
    "simulation": "simulation with the experiment's noise",
    "measured": "measured",
}


def scale_line(settings: dict, *more: str) -> str:
    """'Scale quick, seed 1; ...' from a rule's settings."""
    return "; ".join([f"Scale {settings['scale']['name']}, seed {settings['seed']}", *more])


def chain_line(samples: int, verdict: dict) -> str:
    """How the chains of one T ran and how far they got, from `posterior/*.json`.

    Only a verdict that says so is called converged.
    """
    acceptance = "/".join(f"{share:.2f}" for share in verdict["acceptance"])
    line = (
        f"T={samples}: N={verdict['draws_per_sample']}, "
        f"σq={1e6 * verdict['step_length_m']:.3g} µm, {verdict['steps']} steps, "
        f"acc. {acceptance}, max R-hat {verdict['rhat_max']:.3f}, "
        f"min ESS {verdict['ess_min']:.0f}"
    )
    return line + (" (converged)" if verdict["converged"] else "")


def chain_lines(verdicts: dict[int, dict]) -> list[str]:
    """One line per T; a last one says what to make of chains that fail the criterion."""
    lines = [chain_line(samples, verdict) for samples, verdict in verdicts.items()]
    failed = [samples for samples, verdict in verdicts.items() if not verdict["converged"]]
    if failed:
        threshold = verdicts[failed[0]]["rhat_threshold"]
        names = ", ".join(str(samples) for samples in failed)
        lines.append(f"R-hat is not below {threshold:g} for T = {names}: preliminary.")
    return lines
