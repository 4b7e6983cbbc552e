"""Small studies made only to check the papers' claims; every function returns plain data."""
