"""The strain gauge for moiré superlattices: scanning-probe images of stacked two-dimensional crystals in; drift, moiré
lattice, twist and heterostrain out, each with its uncertainty.

    import moiregauge as mg

    results = mg.analyze(["scans/"], seed=1)
    results.sets[0].mean.twist_deg          # value ± σ
    results.report("out/")                  # what the program writes

Lengths are nm, angles degrees counter-clockwise in laboratory axes, strains per cent, drift nm/min. Row 0 of an array is
its bottom line.
"""

from moiregauge import campaign, results
from moiregauge._analyze import Campaign, analyze, analyze_moires, map, measure, read
from moiregauge._asks import calibrate, convert, inspect, moire, plan, simulate, validate
from moiregauge._core import __version__
from moiregauge._errors import CaveatWarning, FailedFileWarning, MeasureError, ReadError
from moiregauge._options import Options
from moiregauge._scan import Channel, Scan
from moiregauge.results import Estimate, MapResults, Results

__all__ = [
    "Campaign",
    "CaveatWarning",
    "Channel",
    "Estimate",
    "FailedFileWarning",
    "MapResults",
    "MeasureError",
    "Options",
    "ReadError",
    "Results",
    "Scan",
    "__version__",
    "analyze",
    "analyze_moires",
    "calibrate",
    "campaign",
    "convert",
    "inspect",
    "map",
    "measure",
    "moire",
    "plan",
    "read",
    "results",
    "simulate",
    "validate",
]
