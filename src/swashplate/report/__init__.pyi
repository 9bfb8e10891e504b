from . import figures as figures
from . import fit_report as fit_report
from . import scene as scene
