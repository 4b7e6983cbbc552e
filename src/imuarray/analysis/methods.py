"""Ways to calibrate and to sample; nothing heavy loads here, so that the command line can look."""

CALIBRATION = ("gauss-newton", "bcd")  # of the papers' model
MODELS = ("sensors", "papers")  # or a diagnosis.json
SAMPLING = ("auto", "independent", "nuts", "pmmh")
MOTION_PRIORS = ("proper", "flat")
EXPORTS = ("json", "kalibr", "urdf", "csv")
RATES = ("declared", "spread")  # what p(omega | y_g) is made from
