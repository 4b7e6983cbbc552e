"""The page of a diagnosis: its answers, figures and tables on one page."""
