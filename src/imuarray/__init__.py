"""imuarray: calibration of inertial sensor arrays, with the uncertainty stated.

In a notebook::

    import imuarray

    recording = imuarray.read_recording("rec.nc")
    calibration = imuarray.calibrate(recording, method="gauss-newton")
    posterior = imuarray.sample(recording, method="nuts")
    diagnosis = imuarray.diagnose(recording)
    imuarray.plots.positions(calibration)

The folders follow the path of the data: array geometry -> motion -> measurement model (and
effects) -> simulation and recordings -> estimation -> posterior -> studies -> diagnosis -> figures
and claims. Heavy modules load when they are first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_HOME = {
    "Array": "imuarray.geometry",
    "ArrayModel": "imuarray.model",
    "InputError": "imuarray.errors",
    "Online": "imuarray.estimation.online",
    "Recording": "imuarray.recording",
    "apply": "imuarray.analysis",
    "calibrate": "imuarray.analysis",
    "calibrate_bcd": "imuarray.estimation",
    "calibrate_gauss_newton": "imuarray.estimation",
    "diagnose": "imuarray.diagnosis.document",
    "diagnosed": "imuarray.analysis",
    "estimate_motion": "imuarray.estimation",
    "first_order": "imuarray.analysis",
    "mimu4444": "imuarray.geometry",
    "read_calibration": "imuarray.analysis",
    "read_csv": "imuarray.analysis",
    "read_effects": "imuarray.model",
    "read_mimu": "imuarray.analysis",
    "read_posterior": "imuarray.analysis",
    "read_recording": "imuarray.recording",
    "sample": "imuarray.analysis",
    "select": "imuarray.analysis",
    "simulate": "imuarray.analysis",
    "summary": "imuarray.analysis",
    "write_recording": "imuarray.recording",
    "write_report": "imuarray.report.write",
}

__all__ = ["__version__", "plots", *_HOME]

if TYPE_CHECKING:  # what the names above are, for type checkers and editors
    from imuarray import plots as plots
    from imuarray.analysis import apply as apply
    from imuarray.analysis import calibrate as calibrate
    from imuarray.analysis import diagnosed as diagnosed
    from imuarray.analysis import first_order as first_order
    from imuarray.analysis import read_calibration as read_calibration
    from imuarray.analysis import read_csv as read_csv
    from imuarray.analysis import read_mimu as read_mimu
    from imuarray.analysis import read_posterior as read_posterior
    from imuarray.analysis import sample as sample
    from imuarray.analysis import select as select
    from imuarray.analysis import simulate as simulate
    from imuarray.analysis import summary as summary
    from imuarray.diagnosis.document import diagnose as diagnose
    from imuarray.errors import InputError as InputError
    from imuarray.estimation import calibrate_bcd as calibrate_bcd
    from imuarray.estimation import calibrate_gauss_newton as calibrate_gauss_newton
    from imuarray.estimation import estimate_motion as estimate_motion
    from imuarray.estimation.online import Online as Online
    from imuarray.geometry import Array as Array
    from imuarray.geometry import mimu4444 as mimu4444
    from imuarray.model import ArrayModel as ArrayModel
    from imuarray.model import read_effects as read_effects
    from imuarray.recording import Recording as Recording
    from imuarray.recording import read_recording as read_recording
    from imuarray.recording import write_recording as write_recording
    from imuarray.report.write import write_report as write_report


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(import_module(_HOME[name]), name)
    if name == "plots":
        return import_module("imuarray.plots")
    raise AttributeError(f"module 'imuarray' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
