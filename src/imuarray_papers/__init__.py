"""The reproduction of two papers with the tool `imuarray`, which knows nothing of it.

`studies` compute and `claims` judge what the papers state, `figures` draw it, `measured` and
`blind` put the model to the test, `pipeline` serves the Snakemake workflow. The papers' own
algorithms are in `estimation` and `posterior`; `reference` has them written out, to read first.
`python -m imuarray_papers --help`: what the papers did, for a recording of one's own.
"""
