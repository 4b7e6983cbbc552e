"""Parts that the workflow's rules and scripts share: names of files, settings, sources, jobs."""
