"""Rigid-body physics on bare SI numbers and arrays; knows no spacecraft, no files and no screen."""
