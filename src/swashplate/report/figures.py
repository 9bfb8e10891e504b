"""The figures, by name: `matplotlib.figure.Figure` objects in the units that people read."""

from swashplate.report.comparison import plot_comparison as plot_comparison
from swashplate.report.files import save_figure as save_figure
from swashplate.report.overview import plot_maneuvers_overview as plot_maneuvers_overview
from swashplate.report.signals import plot_simulation as plot_simulation
from swashplate.report.steady_map import plot_steady_map as plot_steady_map
