from lidarcheck.api import calibrate as calibrate
from lidarcheck.api import read_case as read_case
from lidarcheck.api import read_ideal as read_ideal
from lidarcheck.api import read_model as read_model
from lidarcheck.api import read_scan as read_scan
from lidarcheck.api import write_model as write_model
from lidarcheck.api import write_scan as write_scan
from lidarcheck.calibration.parameters.workflow import Calibration as Calibration
from lidarcheck.cases.case import Case as Case
from lidarcheck.errors import LidarcheckError as LidarcheckError
from lidarcheck.explain.report.explanation import Explanation as Explanation
from lidarcheck.explain.workflow import explain as explain
from lidarcheck.kpi.compare import compare as compare
from lidarcheck.kpi.comparison import Comparison as Comparison
from lidarcheck.model.chain import simulate as simulate
from lidarcheck.model.spec import Model as Model
from lidarcheck.scan import IdealScan as IdealScan
from lidarcheck.scan import Scan as Scan

__version__: str
