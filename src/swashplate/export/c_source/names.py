"""Names that the exported C takes for itself; those of a model give way to them."""

from __future__ import annotations

FUNCTIONS = """
get_number set_number is_finite all_finite in_range index_of_name place_tap read_window
constant_window fill_lines inputs_in_range put_inputs take_sample one_sample READY VALUES
CONSTANTS_FROM rested_start settled_start check_parameters compute_constants switch_terms ranges
value_table option_places parameter_names output_names input_names option_names name_at_index
is_index get_flag set_flag input_ranges flag_places finite_outputs fill_line rings place_past
place_late past_sample past_value put_past fill_past late_values largest_values found_values passes
is_settled
"""
"""Functions, tables and constants of the source, as they are."""
PUBLIC = """
size value_count init reset settle step correct output limits set_input clear_input set get
set_option get_option set_step get_step update find find_output find_input find_option
parameter_name output_name sentence valid memory inputs measured value range window ring
"""
"""Functions and structs, after the prefix."""
CONSTANTS = """
OK BAD_VALUE UNSTABLE BAD_DELAY DOMAIN NOT_READY OUTPUTS PARAMETERS INPUTS OPTIONS LINE API H
VALUES_H
"""
"""Statuses, counts and macros, after the prefix in capitals."""
MEMBERS = """
step inputs now before whole fraction line before_record newest stale settled ready started past
past_before past_newest
"""
"""Members of the structs that hold all of a model."""
PART_MEMBERS = ("", "_options", "_given", "_signals", "_limits", "_constants")
"""What the members of a part end with."""
ARGUMENTS = "m status i measured"
"""Other arguments and variables of functions that take the inputs, and a member beside them."""
FILES = """
assert complex ctype errno fenv float inttypes iso646 limits locale main math setjmp signal stdarg
stdbool stddef stdint stdio stdlib string tgmath time wchar wctype
"""
"""Headers of C's library, and the example: a model's files are not called so."""
