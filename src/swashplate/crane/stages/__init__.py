"""Equations of what stands between the stick and the drives, each as a model."""
