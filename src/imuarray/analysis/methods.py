"""Ways to calibrate and to sample; nothing heavy loads here, so that the command line can look."""

MODELS = ("sensors", "papers")  # or a calibration
SAMPLING = ("auto", "independent", "nuts")
EXPORTS = ("json", "kalibr", "urdf", "csv")


def is_file(model) -> bool:
    """True of the path of a calibration, which has a model; False of a model's name."""
    return str(model).endswith(".nc")
