import swashplate.report.style

from .analysis import plot_bands as plot_bands
from .analysis import plot_compensation as plot_compensation
from .analysis import plot_envelope as plot_envelope
from .analysis import plot_limit_timeline as plot_limit_timeline
from .analysis import plot_sobol as plot_sobol
from .analysis import plot_tornado as plot_tornado
from .analysis import plot_whatif as plot_whatif
from .campaign import plot_campaign as plot_campaign
from .crane import plot_crane as plot_crane
from .crane_studies import plot_follow as plot_follow
from .crane_studies import plot_judgment as plot_judgment
from .crane_studies import plot_operability as plot_operability
from .crane_studies import plot_orifice as plot_orifice
from .crane_studies import plot_residuals as plot_residuals
from .crane_studies import plot_sectors as plot_sectors
from .fit import plot_fit as plot_fit
from .fit import plot_overlay as plot_overlay
from .fit import plot_waterfall as plot_waterfall
from .fit import save_fit_figures as save_fit_figures
from .fit import save_run_figures as save_run_figures
from .instruments import plot_current as plot_current
from .instruments import plot_encoder as plot_encoder
from .linear import plot_bode as plot_bode
from .simulation import plot_comparison as plot_comparison
from .simulation import plot_full_order as plot_full_order
from .simulation import plot_maneuvers_overview as plot_maneuvers_overview
from .simulation import plot_signals as plot_signals
from .simulation import plot_simulation as plot_simulation
from .steady import plot_steady_map as plot_steady_map

save_figure = swashplate.report.style.save_figure
