"""The sea under a crane: seaways, the ship's motion in them, how often they come, extremes."""
