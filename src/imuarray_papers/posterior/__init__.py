"""PmMH, the sampler of paper 2021: its likelihood, tuning and chains."""
