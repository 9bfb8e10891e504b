"""From equations to code: traced into a graph, differentiated, scheduled, printed."""
