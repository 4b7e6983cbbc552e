"""Least squares for any model: the motion eliminated sample by sample, effects, priors."""
