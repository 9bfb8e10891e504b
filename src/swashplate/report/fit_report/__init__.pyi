from .content import write_fit_report as write_fit_report
from .content import write_validation_report as write_validation_report
