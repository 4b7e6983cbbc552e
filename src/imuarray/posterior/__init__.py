"""The positions' posterior: likelihood estimate, chains, tuning, diagnostics."""
