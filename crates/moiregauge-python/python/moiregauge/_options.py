"""Options of an analysis: the settings of the program, and what files do not tell.

Made by `scripts/generate.py` from `crates/moiregauge-report/schema`; not to be edited.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal, TypedDict

Background = Literal["mean", "plane", "quadratic", "cubic", "line-mean"]
FrameOrder = Literal["up", "down", "alternating-up", "alternating-down"]
Grouping = Literal["auto", "folder", "file"]
Lines = Literal["trace", "retrace", "both"]
Method = Literal["autocorrelation", "fourier", "lattice", "paper"]
StrainConvention = Literal["real-space", "k-space"]
TwistSense = Literal["positive", "negative"]


TOLD = ["crop", "frame_direction", "line_rate_hz", "rotation_deg", "sensor_unit", "sensors", "size_nm", "unit", "x_sensor", "y_sensor"]


class Options(TypedDict, total=False):
    """Keyword arguments of `analyze`, `measure`, `map`, `Campaign` and `campaign.run`."""

    background: Background
    """What is subtracted beforehand."""
    calibration: Mapping[str, Any]
    """How well the scanner is calibrated, for the uncertainty budget."""
    channel: str
    """Channel that shows the moiré; `None`: the first of the usual ones that is present."""
    crop: Mapping[str, Any]
    """The block of the image to use."""
    drift: tuple[float, float] | Mapping[str, float]
    """A drift known beforehand; `None`: measure it."""
    drift_draws: int
    """Monte Carlo draws for the drift."""
    exclude: Sequence[str]
    """Scans that are shown but not used: names of files, `*` stands for any characters."""
    exclude_outliers: bool
    """Whether scans that do not fit the others are left out by themselves: one after the other, worst first,
    while the leave-one-out χ² of a scan has p < 0.001/n; never more than a fifth.
    """
    frame_direction: FrameOrder | Sequence[Literal['up', 'down']]
    """Sense of the slow motion."""
    frame_time_sigma_s: float
    """Standard uncertainty of the time of a frame, s: headers hold whole seconds (0.29 s) and are written
    some time after the end of the frame.
    """
    grouping: Grouping
    """How files become sets."""
    image: int
    """Which of several images of the channel in one file, counted from 1; `None`: the first."""
    isotropic_strain_percent: float
    """Standard deviation of the isotropic heterostrain that the layers may have beside the uniaxial one, per
    cent, for the uncertainty budget. The moiré does not show it. The default is a guess, of the size of
    small uniaxial strains; up to 0.06 % the twist stays within 0.001°.
    """
    lattice_angle: Mapping[str, Any]
    """The orientation of one of the layers, if it is known: tells isotropic strain from twist."""
    lattice_angle_2: Mapping[str, Any]
    """The orientation of the other layer, if it is known as well: tells the sense of the twist of equal
    layers.
    """
    layers: str
    """The layers by name: `graphene`, or `graphene/hBN` for graphene on hBN."""
    line: Lines
    """Line directions to use."""
    line_rate_hz: float
    """Lines per second, trace and retrace together."""
    material: str | Mapping[str, Any]
    """The layers: both, or the upper one (layer 2) where there is a `substrate`."""
    method: Method
    """Estimator of the lattice vectors."""
    moire_layers: Sequence[str | Mapping[str, Any]]
    """The layers of each moiré, the largest cell first, where not all moirés are of the same; they take the
    place of `material` and `substrate`.
    """
    moire_waves: tuple[tuple[float, float], tuple[float, float]]
    """Two wave vectors of the moiré, x and y in rad/nm, that belong to the reciprocal vectors of the atoms at
    0° and (hexagonal layers) 120°; about will do. The lattice of a strained moiré has other pairs that can
    be meant; without this, image and orientation choose where they can, and else the least strain.
    """
    moires: int
    """How many moirés every image shows; each is fitted with the others taken off."""
    overlap: bool
    """Use only the region that all scans of a set have in common."""
    rotation_deg: float
    """Angle by which the fast axis is turned against x, degrees, counter-clockwise."""
    scanner: Mapping[str, Any]
    """A measured calibration of the scanner: positions are corrected with it, and its covariance takes the
    place of `calibration` in the budget.
    """
    seed: int
    """Seed of all random numbers."""
    sensor_unit: str
    """Unit of the position sensors of arrays."""
    sensors: str
    """File that holds the position sensors."""
    size_nm: tuple[float, float]
    """Width and height of the image from edge to edge, nm."""
    strain_convention: StrainConvention
    """Form of the strain equation."""
    strain_draws: int
    """Monte Carlo draws for twist and strain, per scan."""
    substrate: str | Mapping[str, Any]
    """The lower layer (layer 1, the reference) where it is another one."""
    twist_sense: TwistSense
    """The sense of the twist, if it is known: an orientation of one of two equal layers leaves it open."""
    unit: str
    """Unit of the values of arrays and pictures."""
    x_sensor: str
    """Channel that is the position sensor along x."""
    y_sensor: str
    """Channel that is the position sensor along y."""
