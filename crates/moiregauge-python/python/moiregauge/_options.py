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
RulerLayer = Literal["auto", "off", "1", "2"]
StrainConvention = Literal["real-space", "k-space"]
TwistSense = Literal["positive", "negative"]


TOLD = ["crop", "frame_direction", "line_rate_hz", "rotation_deg", "sensor_unit", "sensors", "size_nm", "unit", "x_sensor", "y_sensor"]


class Options(TypedDict, total=False):
    """Keyword arguments of `analyze`, `measure`, `map`, `Campaign` and `campaign.run`.

    background: What is subtracted beforehand.
    by_hand: Choices made by hand: which lattice to measure, and where it is.
    calibration: How well the scanner is calibrated, for the uncertainty budget.
    channel: Channel that shows the moiré; `None`: the first of the usual ones that is present.
    crop: The block of the image to use.
    drift: A drift known beforehand; `None`: measure it.
    drift_draws: Monte Carlo draws for the drift.
    drift_prior_nm_per_min: Standard deviation of each component of the drift where scans do not tell it and
        `drift` is not given, nm/min, for the uncertainty budget. The default is what an instrument at rest
        drifts; where a frame is so slow that this would be more than a quarter of the speed at which its
        lines advance, that quarter is taken.
    exclude: Scans that are shown but not used: names of files, `*` stands for any characters.
    exclude_outliers: Whether scans that do not fit the others are left out by themselves: one after the
        other, worst first, while the leave-one-out χ² of a scan has p < 0.001/n; never more than a fifth.
    frame_direction: Sense of the slow motion.
    frame_time_sigma_s: Standard uncertainty of the time of a frame, s: headers hold whole seconds (0.29 s)
        and are written some time after the end of the frame.
    grain: Which grain to use of scans that show several, as their sets are named: `grain 1` is number 1;
        `None`: each is a set of its own.
    grouping: How files become sets.
    image: Which of several images of the channel in one file, counted from 1; `None`: the first.
    isotropic_strain_percent: Standard deviation of the isotropic heterostrain that the layers may have beside
        the uniaxial one, per cent, for the uncertainty budget. The moiré does not show it. The default is a
        guess, of the size of small uniaxial strains; up to 0.06 % the twist stays within 0.001°.
    lattice_angle: The orientation of one of the layers, if it is known: tells isotropic strain from twist.
    lattice_angle_2: The orientation of the other layer, if it is known as well: tells the sense of the twist
        of equal layers.
    layers: The layers by name: `graphene`, or `graphene/hBN` for graphene on hBN.
    line: Line directions to use.
    line_rate_hz: Lines per second, trace and retrace together.
    material: The layers: both, or the upper one (layer 2) where there is a `substrate`.
    method: Estimator of the lattice vectors.
    moire_layers: The layers of each moiré, the largest cell first, where not all moirés are of the same; they
        take the place of `material` and `substrate`.
    moire_waves: Two wave vectors of the moiré, x and y in rad/nm, that belong to the reciprocal vectors of
        the atoms at 0° and (hexagonal layers) 120°; about will do. The lattice of a strained moiré has other
        pairs that can be meant; without this, image and orientation choose where they can, and else the least
        strain.
    moires: How many moirés every image shows; each is fitted after the others are subtracted.
    overlap: Use only the region that all scans of a set have in common.
    rotation_deg: Angle by which the fast axis is turned against x, degrees, counter-clockwise.
    ruler: The layer whose atoms the frames show beside the moiré and which measures them in place of the
        scanner. Of several moirés, which need not have this layer in common, only where it is said.
    ruler_from: Frames of the same scanner that show the atoms of a layer, at another magnification: they
        calibrate it, in place of `scanner`. Of layer 2, or of that which `ruler` names.
    ruler_magnification_percent: Standard deviation of the change of the gain along x and along y between the
        frames of `ruler_from` and the scans, per cent, for the uncertainty budget. The default is that of
        open piezo tubes whose frames differ by a twentieth of their range: their sensitivity grows with the
        voltage, by some 10 % from the smallest to the full range.
    ruler_strain_percent: Standard deviation of the strain that this layer itself may have, along x and along
        y, per cent, for the uncertainty budget.
    scanner: A measured calibration of the scanner: positions are corrected with it, and its covariance takes
        the place of `calibration` in the budget.
    seed: Seed of all random numbers.
    sensor_unit: Unit of the position sensors of arrays.
    sensors: File that holds the position sensors.
    settings: A file of settings (TOML), one of results, or settings that results hold; other options come on
        top of it.
    size_nm: Width and height of the image from edge to edge, nm.
    strain_convention: Form of the strain equation.
    strain_draws: Monte Carlo draws for twist and strain, per scan.
    substrate: The lower layer (layer 1, the reference) where it is another one.
    twist_sense: The sense of the twist, if it is known: an orientation of one of two equal layers leaves it
        open.
    unit: Unit of the values of arrays and pictures.
    x_sensor: Channel that is the position sensor along x.
    y_sensor: Channel that is the position sensor along y.
    """

    background: Background
    by_hand: Mapping[str, Any]
    calibration: Mapping[str, Any]
    channel: str
    crop: Mapping[str, Any]
    drift: tuple[float, float] | Mapping[str, float]
    drift_draws: int
    drift_prior_nm_per_min: float
    exclude: Sequence[str]
    exclude_outliers: bool
    frame_direction: FrameOrder | Sequence[Literal['up', 'down']]
    frame_time_sigma_s: float
    grain: int
    grouping: Grouping
    image: int
    isotropic_strain_percent: float
    lattice_angle: Mapping[str, Any]
    lattice_angle_2: Mapping[str, Any]
    layers: str
    line: Lines
    line_rate_hz: float
    material: str | Mapping[str, Any]
    method: Method
    moire_layers: Sequence[str | Mapping[str, Any]]
    moire_waves: tuple[tuple[float, float], tuple[float, float]]
    moires: int
    overlap: bool
    rotation_deg: float
    ruler: RulerLayer
    ruler_from: str | Sequence[str]
    ruler_magnification_percent: float
    ruler_strain_percent: float
    scanner: str | Mapping[str, Any]
    seed: int
    sensor_unit: str
    sensors: str
    settings: str | Mapping[str, Any]
    size_nm: tuple[float, float]
    strain_convention: StrainConvention
    strain_draws: int
    substrate: str | Mapping[str, Any]
    twist_sense: TwistSense
    unit: str
    x_sensor: str
    y_sensor: str
