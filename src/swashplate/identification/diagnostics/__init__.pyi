from .data_checks import beside_the_drives as beside_the_drives
from .data_checks import check_model as check_model
from .data_checks import check_runs as check_runs
from .data_checks import refuse_unsound as refuse_unsound
from .data_checks import spike_findings as spike_findings
