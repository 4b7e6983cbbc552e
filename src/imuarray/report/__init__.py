"""A diagnosis told to people: its answers, figures and tables on one page."""
