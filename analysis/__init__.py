"""Data in, data out; plots and reports on top, in files of their own.

Runs: ``runs``, ``sweeps``, ``comparison``. Ears: ``hearing``, ``recordings``.
Stability: ``laws``, ``models``, ``linear``, ``nonlinear``, ``certificates``,
``design``, gathered by ``stability``. Pages and files: ``reporting``. The command
line: ``commands``.
"""
