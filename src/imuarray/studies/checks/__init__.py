"""Small studies made only to check the papers' claims; every function returns plain data.

They live in a folder of their own because the sampling rules rest on the files of
`imuarray.studies`: editing a check must not sample again.
"""
