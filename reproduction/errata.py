"""Errata of Kruse (2001), as far as they touch a figure or a table that is reproduced here."""

ERRATA = {
    1: "Equation 6.61: the polynomial of a negative current is taken of the signed current: even "
    "powers keep their own sign.",
    2: "Equations 3.8 and 3.9: the rate limits act on the output's position, not as pure rates, "
    "which would lose the steady level.",
    3: "Equation 3.7: the card's filter with its second derivative and ω² on the right; C is in "
    "A/s², not in A.",
    5: "Signs and units of tables 4.3, 4.4 and 8.1: V_{dz} of the slew card's negative channel is "
    "negative, the decay positive, G_{2} is in A/V² and G_{3} in A/V³; negative channels work on "
    "magnitudes.",
    6: "Table 8.3 prints the rate limits with signs reversed against table 8.2, for the same card.",
    7: "The slew card's damping ratio of 1.4157 gives no overshoot, whatever the text says of one.",
    13: "Equation 6.67: the root is taken of Z_{9} − δP, as the published parameters need it.",
    24: "Equations 7.3 and 7.4 and table 7.1 seem to have hoist and luff exchanged; the factor 2π "
    "is missing.",
    25: "Equation 7.6: the inequality is reversed.",
    29: "196 deg/s would need more oil than the hoist's pumps deliver at 1774 rpm; the speed scale "
    "is Kruse's all the same.",
    31: "Kruse's routine reads the current one sample ahead; here nothing looks ahead (at "
    "most 0.13 deg/s).",
    33: "The filters of figure 7.4 lag those of figure 7.3 by half a sample; speeds are drawn "
    "through those of figure 7.4, as Kruse (2001) drew them.",
}
"""By number in the project's list of errata. ``_{...}`` is a subscript."""
