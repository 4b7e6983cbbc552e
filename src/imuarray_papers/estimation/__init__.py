"""ML-BCD, the search of paper 2017."""
