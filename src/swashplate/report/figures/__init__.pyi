import swashplate.report.style

from .analysis import plot_compensation as plot_compensation
from .analysis import plot_envelope as plot_envelope
from .analysis import plot_limit_timeline as plot_limit_timeline
from .analysis import plot_tornado as plot_tornado
from .analysis import plot_whatif as plot_whatif
from .campaign import plot_campaign as plot_campaign
from .campaign import plot_channel as plot_channel
from .campaign import plot_overview as plot_overview
from .campaign import plot_prediction as plot_prediction
from .crane import plot_crane as plot_crane
from .crane import plot_follow as plot_follow
from .crane import plot_sweep as plot_sweep
from .crane_verdicts import plot_assessment as plot_assessment
from .crane_verdicts import plot_operability as plot_operability
from .linear import plot_bode as plot_bode
from .simulation import plot_comparison as plot_comparison
from .simulation import plot_full_order as plot_full_order
from .simulation import plot_maneuver as plot_maneuver
from .simulation import plot_signals as plot_signals
from .simulation import plot_simulation as plot_simulation

save_figure = swashplate.report.style.save_figure
