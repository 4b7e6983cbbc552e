"""Ways to calibrate and to sample; nothing heavy loads here, so that the command line can look."""

CALIBRATION = ("gauss-newton", "bcd")  # of the papers' model
MODELS = ("sensors", "papers")  # or a calibration
SAMPLING = ("auto", "independent", "nuts", "pmmh")
MOTION_PRIORS = ("proper", "flat")
EXPORTS = ("json", "kalibr", "urdf", "csv")
RATES = ("declared", "spread")  # what p(omega | y_g) is made from


def is_file(model) -> bool:
    """True of the path of a calibration, which has a model; False of a model's name."""
    return str(model).endswith(".nc")
