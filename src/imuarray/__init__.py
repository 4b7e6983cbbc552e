"""imuarray: calibration of inertial sensor arrays, with the uncertainty stated.

In a notebook::

    import imuarray

    recording = imuarray.read_recording("rec.nc")
    calibration = imuarray.calibrate(recording)
    posterior = imuarray.sample(recording)
    diagnosis = imuarray.diagnose(recording)
    imuarray.plots.positions(calibration)

docs/architecture.md says what each folder holds. Heavy modules load when they are first used.
"""

import lazy_loader

__version__ = "1.0.0"
# the names above and others, as `__init__.pyi` lists them
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
