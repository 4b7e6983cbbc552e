"""The papers' Monte Carlo studies; every function returns a table."""
