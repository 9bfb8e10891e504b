"""What Kruse (2001) reports, again: his figures simulated, his tables and his errors recomputed.

Source: Kruse (2001), chapters 4 and 7, figure 9.1 and the tables of chapters 4, 7 and 8. Its
measurements are not at hand: every curve is simulated, every campaign virtual, and says so.
"""
