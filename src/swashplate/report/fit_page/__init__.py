"""The report of a fit or a validation: one HTML file that needs nothing else, figures as files."""

from swashplate.report.fit_page.files import save_fit_figures as save_fit_figures
from swashplate.report.fit_page.files import save_run_figures as save_run_figures
from swashplate.report.fit_page.page import write_fit_report as write_fit_report
from swashplate.report.fit_page.validation_page import (
    write_validation_report as write_validation_report,
)
