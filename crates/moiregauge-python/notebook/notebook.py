"""Prints the notebook that is tried in JupyterLab."""

import json

CELLS = [
    "import moiregauge as mg\nfrom moiregauge import plot\n"
    "folder = mg.simulate('.', name='scans', seed=3, raster={'scans': 4, 'pixels': [128, 128]}, force=True)[0]",
    "r = mg.analyze(folder, progress=True)\nr",
    "plot.twist_strain(r).figure;",
    "print('it begins'); mg.validate(sets=100000)",
    "print('the session goes on:', mg.analyze(folder).sets[0].mean.twist_deg)",
]


def cell(source):
    """A cell that has not run."""
    return {"cell_type": "code", "metadata": {}, "execution_count": None, "outputs": [], "source": source}


kernel = {"kernelspec": {"name": "python3", "display_name": "Python 3", "language": "python"}}
print(json.dumps({"nbformat": 4, "nbformat_minor": 4, "metadata": kernel, "cells": [cell(one) for one in CELLS]}))
