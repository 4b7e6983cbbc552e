"""imuarray: calibration of inertial sensor arrays, with the uncertainty stated.

The folders follow the path of the data: array geometry -> motion -> measurement
model (and effects) -> simulation and recordings -> estimation -> posterior -> studies ->
figures and claims.
Heavy modules load when they are first used.
"""

from importlib import import_module

__version__ = "0.1.0"

_HOME = {
    "Array": "imuarray.geometry",
    "mimu4444": "imuarray.geometry",
    "ArrayModel": "imuarray.model",
    "Recording": "imuarray.recording",
    "read_recording": "imuarray.recording",
    "write_recording": "imuarray.recording",
    "calibrate_bcd": "imuarray.estimation",
    "calibrate_gauss_newton": "imuarray.estimation",
    "estimate_motion": "imuarray.estimation",
}

__all__ = ["__version__", *_HOME]


def __getattr__(name):
    if name in _HOME:
        return getattr(import_module(_HOME[name]), name)
    raise AttributeError(f"module 'imuarray' has no attribute {name!r}")


def __dir__():
    return sorted(__all__)
