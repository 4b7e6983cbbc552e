"""What a person does with one recording: from a `Recording` to labelled datasets.

The commands and the notebook call the same functions; names load when they are first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

_HOME = {
    "apply": "motion",
    "calibrate": "calibration",
    "density_of": "density",
    "diagnosed": "extension",
    "first_order": "prepare",
    "model_of": "model",
    "prior_of": "density",
    "read_calibration": "files",
    "read_csv": "files",
    "read_mimu": "files",
    "read_posterior": "files",
    "sample": "sampling",
    "select": "prepare",
    "simulate": "prepare",
    "summary": "sampling",
}

__all__ = list(_HOME)

if TYPE_CHECKING:
    from imuarray.analysis.calibration import calibrate as calibrate
    from imuarray.analysis.density import density_of as density_of
    from imuarray.analysis.density import prior_of as prior_of
    from imuarray.analysis.extension import diagnosed as diagnosed
    from imuarray.analysis.files import read_calibration as read_calibration
    from imuarray.analysis.files import read_csv as read_csv
    from imuarray.analysis.files import read_mimu as read_mimu
    from imuarray.analysis.files import read_posterior as read_posterior
    from imuarray.analysis.model import model_of as model_of
    from imuarray.analysis.motion import apply as apply
    from imuarray.analysis.prepare import first_order as first_order
    from imuarray.analysis.prepare import select as select
    from imuarray.analysis.prepare import simulate as simulate
    from imuarray.analysis.sampling import sample as sample
    from imuarray.analysis.sampling import summary as summary


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(import_module(f"imuarray.analysis.{_HOME[name]}"), name)
    raise AttributeError(f"module 'imuarray.analysis' has no attribute {name!r}")
