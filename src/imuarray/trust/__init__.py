"""Reasons why an answer is not to be trusted, as sentences; none where it holds.

A calibration's file is whole and of these IMUs (`checked`); its numbers are held against the
drawing, the still poses, and the recording taken for the motion of a rigid array.
"""

from imuarray.trust.checked import (
    effect_names,
    parameters_of,
    reasons_in,
    require_fit,
    require_labels,
    values_of,
)
from imuarray.trust.misfit import of_file, of_first_order, reasons_of_poses
from imuarray.trust.reasons import (
    reasons_of_calibration,
    reasons_of_diagnosis,
    reasons_of_motion,
    reasons_of_posterior,
)
from imuarray.trust.suspects import ends
