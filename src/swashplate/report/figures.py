"""The figures, by name: `matplotlib.figure.Figure` objects in the units that people read."""

from swashplate.report.bode_view import plot_bode as plot_bode
from swashplate.report.campaign_page import plot_campaign as plot_campaign
from swashplate.report.comparison import plot_comparison as plot_comparison
from swashplate.report.current_view import plot_current as plot_current
from swashplate.report.encoder_view import plot_encoder as plot_encoder
from swashplate.report.files import save_figure as save_figure
from swashplate.report.overview import plot_maneuvers_overview as plot_maneuvers_overview
from swashplate.report.signals import plot_simulation as plot_simulation
from swashplate.report.steady_map import plot_steady_map as plot_steady_map
