from . import plots as plots
from .analysis.calibration import calibrate as calibrate
from .analysis.export import export as export
from .analysis.logs import open_logs as open_logs
from .analysis.motion import apply as apply
from .analysis.prepare import first_order as first_order
from .analysis.prepare import read_calibration as read_calibration
from .analysis.prepare import read_mimu as read_mimu
from .analysis.prepare import read_posterior as read_posterior
from .analysis.prepare import select as select
from .analysis.prepare import simulate as simulate
from .analysis.sampling import sample as sample
from .analysis.sampling import summary as summary
from .diagnosis.document import diagnose as diagnose
from .engine.dataset import diagnosed as diagnosed
from .errors import InputError as InputError
from .firstorder.noise import allan as allan
from .geometry.array import Array as Array
from .geometry.boards import mimu4444 as mimu4444
from .model.array_model import ArrayModel as ArrayModel
from .model.effects import read_effects as read_effects
from .recording.format import read_recording as read_recording
from .recording.format import write_recording as write_recording
from .recording.record import Recording as Recording
from .report.write import write_report as write_report

__version__: str
