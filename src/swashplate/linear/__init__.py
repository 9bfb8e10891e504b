"""Small motions: linear models at an operating point, and frequency responses large and small."""
