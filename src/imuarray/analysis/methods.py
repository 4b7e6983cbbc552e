"""Ways to calibrate and to sample; nothing heavy loads here, so that the command line can look."""

CALIBRATION = ("gauss-newton", "bcd")  # of the papers' model
MODELS = ("sensors", "papers")  # or a calibration
SAMPLING = ("auto", "independent", "nuts", "pmmh")
MOTION_PRIORS = ("proper", "flat")
EXPORTS = ("json", "kalibr", "urdf", "csv")
RATES = ("declared", "spread")  # what p(omega | y_g) is made from


def is_file(model) -> bool:
    """Whether this is no name of a model, but the path of a calibration that has one."""
    return str(model).endswith(".nc")
