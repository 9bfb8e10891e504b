from .content import write_fit_report as write_fit_report
from .content import write_validation_report as write_validation_report
from .html_page import find_browser as find_browser
from .html_page import print_report as print_report
from .live import write_live_page as write_live_page
from .live import write_machine_page as write_machine_page
from .runs import shown_runs as shown_runs
from .runs import write_samples as write_samples
