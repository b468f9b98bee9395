"""Data in, data out; plots and reports on top, in files of their own.

``hearing``: how well sounds are located. ``runs``: metrics, pictures and results of
one run. ``sweeps``: many runs, and laws side by side. ``gains``: the laws' curves,
and gains from requirements. ``stability``: models, margins, maps, certificates.
"""
