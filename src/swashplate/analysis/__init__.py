"""What a drive can do and what limits it: envelope, what-if, sizing, compensation."""
