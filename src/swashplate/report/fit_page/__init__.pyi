from .files import save_fit_figures as save_fit_figures
from .files import save_run_figures as save_run_figures
from .page import write_fit_report as write_fit_report
from .validation_page import write_validation_report as write_validation_report
