"""First-order calibration of each triad from still poses, as paper 2021 does it (section IV-B)."""
