"""The figures, by name: `matplotlib.figure.Figure` objects in the units that people read."""

from swashplate.report.bands_view import plot_bands as plot_bands
from swashplate.report.bode_view import plot_bode as plot_bode
from swashplate.report.campaign_page import plot_campaign as plot_campaign
from swashplate.report.comparison import plot_comparison as plot_comparison
from swashplate.report.compensation_view import plot_compensation as plot_compensation
from swashplate.report.current_view import plot_current as plot_current
from swashplate.report.encoder_view import plot_encoder as plot_encoder
from swashplate.report.envelope_view import plot_envelope as plot_envelope
from swashplate.report.files import save_figure as save_figure
from swashplate.report.fit_view import plot_fit as plot_fit
from swashplate.report.full_order_view import plot_full_order as plot_full_order
from swashplate.report.limit_timeline_view import plot_limit_timeline as plot_limit_timeline
from swashplate.report.overview import plot_maneuvers_overview as plot_maneuvers_overview
from swashplate.report.sensitivity_view import plot_sobol as plot_sobol
from swashplate.report.sensitivity_view import plot_tornado as plot_tornado
from swashplate.report.signals import plot_simulation as plot_simulation
from swashplate.report.steady_map import plot_steady_map as plot_steady_map
from swashplate.report.whatif_view import plot_whatif as plot_whatif
