"""The report of a fit: one HTML file that needs nothing else, and its figures as files."""

from swashplate.report.fit_page.files import save_fit_figures as save_fit_figures
from swashplate.report.fit_page.page import write_fit_report as write_fit_report
