"""What analyses and maps find: frozen dataclasses of the published documents, with units in the names.

Made by `scripts/generate.py` from `crates/moiregauge-report/schema`; not to be edited.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from moiregauge._base import EstimateBase, MapBase, ResultsBase
from moiregauge._document import Document, decoded_by, several

__all__ = [
    "AgreementResult",
    "AssumedDriftResult",
    "AtomicImages",
    "AtomicResult",
    "Background",
    "BudgetColumn",
    "BudgetResult",
    "ByHand",
    "Calibration",
    "CandidateResult",
    "Caveat",
    "ChecksResult",
    "Choice",
    "ColorMap",
    "CombinedResult",
    "ConsistencyResult",
    "Conventions",
    "Coordinates",
    "Crop",
    "Curvature",
    "DeviceResult",
    "DislocationResult",
    "DomainsResult",
    "DriftChangeResult",
    "DriftFitResult",
    "DriftMonteCarloResult",
    "DriftResult",
    "Estimate",
    "FailedInput",
    "FrameOrder",
    "GivenDrift",
    "Grouping",
    "HarmonicResult",
    "InputFile",
    "InputProvenance",
    "IsotropicStrainResult",
    "JointResult",
    "KnownOrientation",
    "LatticeDirection",
    "LatticeVector",
    "LineResult",
    "Lines",
    "MapDetailsResult",
    "MapResults",
    "MappedImage",
    "MappedRuler",
    "Mask",
    "MaskCount",
    "MaskShare",
    "Material",
    "MeanCellResult",
    "MeanResult",
    "Method",
    "MoireLayers",
    "NameResult",
    "NamedSet",
    "NamesResult",
    "OtherSenseResult",
    "PatternResult",
    "Provenance",
    "QuantityResult",
    "ReadingsResult",
    "RegimeResult",
    "RegionMeanResult",
    "RegionResult",
    "RegistryResult",
    "ResidualResult",
    "Results",
    "RulerCalibration",
    "RulerLayer",
    "RulerResult",
    "Run",
    "ScanResult",
    "ScanTwistStrain",
    "ScanVector",
    "ScannerCalibration",
    "ScatterResult",
    "SetLatticeResult",
    "SetResult",
    "Settings",
    "ShiftResult",
    "SolutionResult",
    "SplitResult",
    "StrainConvention",
    "StrainMonteCarlo",
    "StrainTensorResult",
    "StripeHarmonicResult",
    "StripePatternResult",
    "StripesResult",
    "TensorNumbers",
    "TensorSigmas",
    "TestedResult",
    "TipVelocity",
    "TrendResult",
    "TwistSense",
    "TwistStrainResult",
    "UndistortedResult",
    "UserSpecified",
    "WantedResult",
    "Window",
]

Background = Literal["mean", "plane", "quadratic", "cubic", "line-mean"]
"""What is subtracted from an image before its lattice is measured."""

ColorMap = Literal["viridis", "grey", "nanoscope", "gwyddion"]
"""A colour map for scans."""

Coordinates = Literal["sensors", "nominal"]
"""Which positions a calibration is of."""

FrameOrder = Literal["up", "down", "alternating-up", "alternating-down"]
"""Sense of the slow motion of one file or of a series."""

Grouping = Literal["auto", "folder", "file"]
"""How files become sets."""

LatticeDirection = Literal["atomic", "reciprocal"]
"""Which vector of an atomic lattice an orientation is that of."""

Lines = Literal["trace", "retrace", "both"]
"""Which line directions are used."""

MappedRuler = Literal["frame", "nodes"]
"""What the atoms of a layer measured."""

Method = Literal["autocorrelation", "fourier", "lattice", "paper"]
"""How the lattice vectors are measured in an image."""

RulerLayer = Literal["auto", "off", "1", "2"]
"""Which layer's atoms are the ruler of a frame that shows them beside the moiré."""

StrainConvention = Literal["real-space", "k-space"]
"""Which form of the strain equation is meant (physics of the two: they differ at second order)."""

TwistSense = Literal["positive", "negative"]
"""Which way layer 2 is turned against layer 1."""


@dataclass(frozen=True, kw_only=True)
class AgreementResult(Document):
    """How images of one place agree."""

    chi2_per_dof: float
    """χ² per degree of freedom of the single images about their average."""
    nodes: int
    """Nodes that two images or more cover."""
    variance_factor: float
    """Factor on all variances that follows from it."""


@dataclass(frozen=True, kw_only=True)
class AssumedDriftResult(Document):
    """A drift of 0 that was assumed: its error is in every σ."""

    line_rate_assumed: bool
    """Whether the line rate was not known either, and one between 0.5 and 10 Hz was assumed."""
    sigma_nm_per_min: float | None
    """Standard deviation of each component, nm/min: that of the settings, or a quarter of the speed of the
    slow scan.
    """


@dataclass(frozen=True, kw_only=True)
class AtomicImages(Document):
    """Images in which the orientation of a layer is measured."""

    channel: str | None = None
    """Their channel, where it is another one than that of the scans."""
    files: tuple[str, ...]
    """The files."""
    layer: int
    """The layer that they show."""


@dataclass(frozen=True, kw_only=True)
class AtomicResult(Document):
    """The orientation of a layer by atomically resolved images."""

    distortion: float | None
    """How far the lattice is from the shape of the material's, relative."""
    drift_nm_per_min: tuple[float | None, float | None] | None
    """Drift in these images, x and y; `null` where it cannot be determined."""
    files: tuple[str, ...]
    """The images."""
    lattice_angle_deg: Estimate
    """Of the layer's reciprocal vectors, modulo its symmetry."""
    layer: int
    """1, the reference, or 2."""
    size: float | None
    """Lattice constant found over that of the material."""


@dataclass(frozen=True, kw_only=True)
class BudgetColumn(Document):
    """Standard deviations of one quantity, source by source; `null` where a contribution is not known.
    `image`, `drift` and `sensor` are the parts of the quantity's `sigma`, the statistical one; `total` is
    its `sigma_total`. The sources are independent, so the squares add up.
    """

    calibration_gain: float | None
    """Gain error common to x and y."""
    calibration_mismatch: float | None
    """Difference of the gains of x and y."""
    calibration_orthogonality: float | None
    """Axes that do not stand at a right angle."""
    drift: float | None
    """Uncertainty of the drift, that of a prior where `drift_assumed` says so; `null` where the drift was not
    removed.
    """
    grid_shape: float | None = None
    """Bends of the grid that no sensor told, where the area does not lie in the middle of the frame; left out
    where it does.
    """
    image: float | None
    """Noise of the images, drift and sensors known exactly."""
    isotropic_strain: float | None
    """Isotropic heterostrain, which the moiré does not show."""
    lattice_constant: float | None
    """Lattice constant of the layers."""
    pitch_convention: float | None = None
    """Whether the nominal size spans N pixels or N − 1; left out where sensors or the format tell."""
    poisson_ratio: float | None
    """Poisson ratio of the layers."""
    ruler_strain: float | None = None
    """Strain of the layer whose atoms are the ruler; left out where the scanner is."""
    sensor: float | None
    """Noise of the position sensors."""
    strained_layer: float | None
    """Which layer is strained."""
    total: float | None
    """All together; `null` where one is not known."""


@dataclass(frozen=True, kw_only=True)
class BudgetResult(Document):
    """Contributions to the uncertainty of a lattice and of all that follows from it."""

    drift_assumed: bool
    """Whether nothing tells the drift, so that its row is that of a prior."""
    heterostrain_percent: BudgetColumn
    """Of `heterostrain_percent`."""
    lattice_angle_deg: BudgetColumn
    """Of `lattice_angle_deg`."""
    strain_axis_lab_deg: BudgetColumn | None
    """Of `strain_axis_lab_deg`; `null` where that is."""
    strain_e1_percent: BudgetColumn
    """Of the first component of `strain_vector_percent`."""
    strain_e2_percent: BudgetColumn
    """Of the second component."""
    strain_interval_95_percent: tuple[float | None, float | None]
    """The interval that holds the magnitude, with 95 % confidence, by these errors, per cent."""
    strain_p_value: float | None
    """Probability that these errors alone give such a strain vector."""
    strain_upper_limit_95_percent: float | None
    """Upper limit of the magnitude of the strain from these errors, 95 % confidence, per cent."""
    strain_vector_covariance: tuple[tuple[float | None, float | None], tuple[float | None, float | None]]
    """Covariance of the strain vector from all sources that are known, per cent²."""
    twist_deg: BudgetColumn
    """Of `twist_deg`."""
    wavelengths_nm: tuple[BudgetColumn, BudgetColumn, BudgetColumn]
    """Of the lengths of the three vectors."""


@dataclass(frozen=True, kw_only=True)
class ByHand(Document):
    """Choices made by hand. Nothing by default."""

    lattice_nm: tuple[tuple[float, float], tuple[float, float]] | None = None
    """Two vectors of the lattice, x and y in nm, in the axes of the results and before drift is taken out; 5
    % off and 3° will do.
    """
    mask: Mask | None = None
    """The pixels to use."""
    near_nm: float | None = None
    """The mean wavelength of the lattice, nm, to 15 %."""
    regions_nm: tuple[tuple[tuple[float, float], ...], ...] = ()
    """The parts of the frame to use: the corners of polygons, nm from its lower left corner, along the lines
    and across them.
    """


@dataclass(frozen=True, kw_only=True)
class Calibration(Document):
    """How well the position sensors (or the scanner, where there are none) are calibrated: standard
    uncertainties, which every scan shares. The defaults are common values; a calibration of your own
    scanner is better.
    """

    gain_percent: float
    """Gain error that x and y have in common, per cent."""
    mismatch_percent: float
    """Difference of the gains of x and y, per cent."""
    orthogonality_mrad: float
    """Deviation of the axes from a right angle, mrad."""
    scanner_bend_percent: float
    """The same of a scanner that no sensor recorded: hysteresis bends lines by a per cent."""
    sensor_bend_percent: float
    """By how much a position sensor bends against a straight line, per cent of the range that it goes through
    in the frame.
    """


@dataclass(frozen=True, kw_only=True)
class CandidateResult(Document):
    """A lattice that an image may show."""

    behind_by: float | None
    """By how many standard errors the lattice that was measured predicts better."""
    cells: int
    """How many of its cells the lattice that was measured has in one: 3 or 4 for a lattice that is made of
    harmonics of that.
    """
    predicted_share: float | None
    """Share of the variance of parts of the frame that were held out, without slow background, that it
    predicts.
    """
    second_wavelengths_nm: tuple[float | None, float | None, float | None] | None
    """The same of a second lattice on top of it, where the two are described together: share and comparison
    are those of both.
    """
    wavelengths_nm: tuple[float | None, float | None, float | None]
    """Lengths of its three shortest vectors by the geometry of the scan, drift included, shortest first."""


@dataclass(frozen=True, kw_only=True)
class Caveat(Document):
    """A reason to trust a number less, with a stable code for programs and words for people."""

    attempts: tuple[str, ...] = ()
    """What was tried before it was raised, one line for each attempt. Left out where nothing was."""
    code: str
    """Stable kebab-case code, as in `no-position-sensors`."""
    message: str
    """What is wrong and what it means for the result."""
    where: str
    """What it concerns: a file, a set, or `analysis`."""


@dataclass(frozen=True, kw_only=True)
class ChecksResult(Document):
    """Errors from the scatter of the scans, to compare with the stated σ."""

    bootstrap: ScatterResult | None
    """From a bootstrap over pairs of up and down scans."""
    leave_one_out: ScatterResult | None
    """From leaving out one scan at a time (jackknife)."""


@dataclass(frozen=True, kw_only=True)
class Choice(Document):
    """Which parts of a report are wanted. `results.json` and the tables always are."""

    colormap: ColorMap
    """Colours of images."""
    figures: bool
    """The figures as SVG files."""
    html: bool
    """`report.html`, with the figures inside."""
    png: bool
    """The figures as PNG files, 300 dots per inch."""


@dataclass(frozen=True, kw_only=True)
class CombinedResult(Document):
    """All sets together."""

    budget: BudgetResult
    """What contributes to their uncertainty, calibration and model included."""
    checks: ChecksResult | None
    """Errors from the scatter of the scans; `null` without a joint fit."""
    consistency: tuple[ConsistencyResult, ...]
    """How far every two sets are apart."""
    drift: DriftResult | None
    """The drift in the middle of the campaign, where one joint fit over all scans describes it."""
    heterostrain_percent: Estimate
    """Magnitude of the uniaxial heterostrain with the noise bias removed, per cent."""
    joint: JointResult | None
    """The joint fit over all scans that made them; `null` for the other methods."""
    lattice_angle_deg: Estimate
    """Orientation of layer 1, degrees in [0, 60)."""
    readings: ReadingsResult
    """What else the lattice can mean."""
    strain_axis_lab_deg: Estimate | None
    """Axis of the strain in the laboratory, degrees in [0, 180); `null` unless significant."""
    strain_axis_lattice_deg: Estimate | None
    """Axis of the strain from layer 1, degrees in [0, 180); `null` unless significant."""
    strain_interval_95_percent: tuple[float | None, float | None]
    """The interval that holds the magnitude of the strain with 95 % confidence, or more, per cent; it begins
    at 0 where noise alone may explain the strain.
    """
    strain_p_value: float | None
    """Probability that noise alone gives such a strain vector."""
    strain_upper_limit_95_percent: float | None
    """Upper limit of the magnitude of the strain, 95 % confidence, per cent."""
    strain_vector_covariance: tuple[tuple[float | None, float | None], tuple[float | None, float | None]]
    """Covariance of the strain vector, per cent²."""
    strain_vector_percent: tuple[float | None, float | None]
    """(ε cos 2φ, ε sin 2φ) with φ the axis in the laboratory, per cent. Average this, not the magnitude."""
    strain_vector_sigma_total_percent: tuple[float | None, float | None] | None = None
    """One standard deviation of each component with everything, calibration and model included, per cent; as
    `sigma_total` of the others.
    """
    twist_deg: Estimate
    """Twist of layer 2 against layer 1, degrees."""
    vectors: tuple[LatticeVector, LatticeVector, LatticeVector]
    """L1, L2 and L3."""


@dataclass(frozen=True, kw_only=True)
class ConsistencyResult(Document):
    """How many standard deviations lie between two sets."""

    drift_sigmas: float | None
    """Between the drift velocities: square root of χ² for two components."""
    sets: tuple[str, str]
    """Names of the two sets."""
    strain_sigmas: float | None
    """Between the strain vectors: square root of χ² for two components."""
    twist_sigmas: float | None
    """Between the twists."""


@dataclass(frozen=True, kw_only=True)
class Conventions(Document):
    """What the numbers mean."""

    angles: str
    """Units and sense of angles."""
    axes: str
    """Directions of the axes."""
    budget: str
    """What the budget is."""
    coordinates: str
    """What the three kinds of coordinates are."""
    drift: str
    """What the drift velocity is the velocity of."""
    heterostrain: str
    """What the magnitude of the strain is."""
    lattice_vectors: str
    """How the three vectors are named."""
    layers: str
    """Which layers these are."""
    sigma: str
    """What `sigma` and `sigma_total` are."""
    strain: str
    """The equation behind twist and strain."""
    strain_axis: str
    """What the axis of the strain is and when it is given."""
    strain_tensor: str
    """What the strain tensor is."""
    strain_vector: str
    """What the strain vector is."""
    strained_layer: str
    """Which layer carries the strain."""
    twist: str
    """What the twist does not contain: its sign, and isotropic strain."""


@dataclass(frozen=True, kw_only=True)
class Crop(Document):
    """A block of pixels as the screen shows it: row 0 is on top."""

    column: int
    """First column, from the left."""
    columns: int
    """Number of columns."""
    rows: int
    """Number of rows."""
    top: int
    """First row, from the top."""


@dataclass(frozen=True, kw_only=True)
class Curvature(Document):
    """How position sensors bend: second derivatives of what they show against where the scanner is."""

    covariance: tuple[tuple[float, float, float, float, float, float], tuple[float, float, float, float, float, float], tuple[float, float, float, float, float, float], tuple[float, float, float, float, float, float], tuple[float, float, float, float, float, float], tuple[float, float, float, float, float, float]]
    """Their covariance."""
    per_um: tuple[float, float, float, float, float, float]
    """Of x by (xx, xy, yy), then of y, per µm."""


@dataclass(frozen=True, kw_only=True)
class DeviceResult(Document):
    """An area for a device."""

    angle_deg: float
    """Direction of the first side, degrees from x."""
    area: RegionResult
    """The area in numbers."""
    centre_nm: tuple[float, float]
    """Centre, nm."""
    rank: int
    """1 is the best."""


@dataclass(frozen=True, kw_only=True)
class DislocationResult(Document):
    """A line along which the lattice does not close."""

    burgers: tuple[int, int]
    """Burgers vector (h, k) on the lattice."""
    place_nm: tuple[float, float]
    """Place, nm."""


@dataclass(frozen=True, kw_only=True)
class DomainsResult(Document):
    """Nodes and triangles in a few numbers; each of them is in `nodes.csv` and `domains.csv`."""

    dislocations: tuple[DislocationResult, ...]
    """Dislocations."""
    extra_nm: tuple[tuple[float, float], ...]
    """Nodes that fit into no triangle, nm."""
    median_twist_deg: float | None
    """Median twist of the triangles, degrees."""
    missing_nm: tuple[tuple[float, float], ...]
    """Places where a node is missing, nm."""
    node_sigma_nm: float | None
    """Median error of the place of a node along an axis, nm; what all nodes share is not in it."""
    nodes: int
    """Nodes found."""
    nodes_are: str
    """`bright` or `dark`."""
    triangles: int
    """Triangles with twist and strain."""
    twist_noise_deg: float | None
    """Median of their errors, degrees."""
    twist_spread_deg: float | None
    """Standard deviation of the twist over the triangles, degrees."""


@dataclass(frozen=True, kw_only=True)
class DriftChangeResult(Document):
    """`A_up − A_down` of the drift within frames."""

    chi2: float
    """χ² that both are zero, two degrees of freedom."""
    x: float
    """Along x, nm/min²."""
    x_sigma: float
    """Its standard error."""
    y: float
    """Along y, nm/min²."""
    y_sigma: float
    """Its standard error."""


@dataclass(frozen=True, kw_only=True)
class DriftFitResult(Document):
    """How well the scans determine the drift."""

    chi2: float | None
    """Weighted sum of squared residuals."""
    condition: float | None
    """Condition number."""
    degrees_of_freedom: int
    """Degrees of freedom."""
    paper_nm_per_min: tuple[float | None, float | None] | None
    """The published estimate (approximate matrices, successive scans compared), x and y, for comparison."""
    rank: int
    """Rank of the six-parameter problem; 6 is full."""


@dataclass(frozen=True, kw_only=True)
class DriftMonteCarloResult(Document):
    """Distribution of the drift over Monte Carlo draws."""

    correlation: float | None
    """Correlation coefficient of the two."""
    draws: int
    """Number of draws."""
    residual_nm: Estimate
    """Mean and standard deviation of the root-mean-square residual, nm."""
    x_nm_per_min: Estimate
    """Mean and standard deviation."""
    y_nm_per_min: Estimate
    """Mean and standard deviation."""


@dataclass(frozen=True, kw_only=True)
class DriftResult(Document):
    """Velocity of the sample in the frame of the sensors."""

    correlation: float | None
    """Correlation coefficient of the two."""
    fit: DriftFitResult | None
    """Quality of the fit; `null` for a given drift."""
    given: bool
    """Whether the user gave it."""
    joint: JointResult | None
    """What a joint fit found; `null` for the other methods."""
    monte_carlo: DriftMonteCarloResult | None
    """The Monte Carlo distribution."""
    x_nm_per_min: Estimate
    """To the right."""
    y_nm_per_min: Estimate
    """Up."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Estimate(EstimateBase):
    """A value with its standard uncertainty in the same unit; `null` where unknown."""

    sigma: float | None
    """One standard deviation. Where `sigma_total` stands beside it, the statistical part of that: noise of
    images and sensors, and the drift.
    """
    sigma_total: float | None = None
    """One standard deviation with everything, calibration and model included: publish this one. Present in
    the means of sets and in `combined`; left out where it is not known, as when the drift was not removed.
    """
    value: float | None
    """The best value."""


@dataclass(frozen=True, kw_only=True)
class FailedInput(Document):
    """An input that could not be used."""

    error: str
    """What was expected and what was found."""
    file: str
    """The file as the user named it."""


@dataclass(frozen=True, kw_only=True)
class GivenDrift(Document):
    """A drift velocity known beforehand."""

    sigma_nm_per_min: float
    """Standard uncertainty of each component, nm/min."""
    x_nm_per_min: float
    """Along x, nm/min."""
    y_nm_per_min: float
    """Along y, nm/min."""


@dataclass(frozen=True, kw_only=True)
class HarmonicResult(Document):
    """A harmonic of the lattice."""

    amplitude: float
    """Amplitude, root mean square over the frame, unit of the image."""
    index: tuple[int, int]
    """(h, k)."""
    noise: float
    """Variance per pixel of white noise as strong as the noise there."""


@dataclass(frozen=True, kw_only=True)
class InputFile(Document):
    """An input, known by its content."""

    bytes: int
    """Its size in bytes."""
    file: str
    """The file as the user named it."""
    sha256: str
    """SHA-256 of its bytes, hexadecimal."""


@dataclass(frozen=True, kw_only=True)
class InputProvenance(Document):
    """Program, seed and inputs."""

    inputs: tuple[InputFile, ...]
    """The files that were analysed."""
    program: str
    """`moiregauge`."""
    run: Run | None = None
    """What was asked, for a repetition."""
    seed: int
    """Seed of all random numbers."""
    version: str
    """Its version."""


@dataclass(frozen=True, kw_only=True)
class IsotropicStrainResult(Document):
    """The twist–biaxial degeneracy in numbers."""

    prior_percent: float
    """The standard deviation of the isotropic strain, from the settings."""
    shifts: tuple[ShiftResult, ...]
    """By how much isotropic strains of layer 2 (tension positive) change `twist_deg`."""
    twist_interval_deg: tuple[float | None, float | None]
    """Range of the twist that is possible with isotropic strains within 1.96 times the prior, either sign of
    the uniaxial strain, and 1.96 σ.
    """


@dataclass(frozen=True, kw_only=True)
class JointResult(Document):
    """Terms of a joint fit; those that are `null` were not used, by the information criterion."""

    acceleration_nm_per_min2: tuple[float | None, float | None] | None
    """Change of the drift velocity, x and y."""
    fast_gain_percent: Estimate | None
    """Gain error of the fast axis."""
    phases_linked: bool
    """Whether phases link the frames, which tightens the drift by an order of magnitude."""
    position_instability_pm: float | None
    """Scatter of the positions beyond the noise of the phases."""
    settling_min: float | None
    """Time constant of an exponential settling, min."""
    tested: tuple[TestedResult, ...]
    """The terms that were tried beside a constant drift."""


@dataclass(frozen=True, kw_only=True)
class KnownOrientation(Document):
    """The orientation of one of the layers, known from elsewhere: an atomic image or the edge of a crystal,
    in the frame of the position sensors and free of drift.
    """

    angle_deg: float
    """Degrees counter-clockwise from x, of any of the equivalent directions."""
    layer: int
    """Layer 1, the reference, or layer 2. For a strained layer the mean over its three directions is meant: a
    single one differs from it by up to (1+ν)ε/2.
    """
    of: LatticeDirection
    """Of which vector."""
    sigma_deg: float
    """Standard uncertainty, degrees."""


@dataclass(frozen=True, kw_only=True)
class LatticeVector(Document):
    """One lattice vector."""

    covariance_nm2: tuple[tuple[float | None, float | None], tuple[float | None, float | None]]
    """Covariance of (x, y), nm²."""
    naive_twist_deg: Estimate
    """2 arcsin(a/2λ), degrees: the twist if nothing were strained; `null` beyond 30°, where the vector is
    that of atoms.
    """
    polar_angle_deg: float | None
    """Direction, degrees counter-clockwise from x, in (−180, 180]."""
    polar_angle_sigma_deg: float | None
    """One standard deviation of the direction, degrees."""
    wavelength_nm: Estimate
    """Length, nm."""
    x_nm: float | None
    """Component to the right, nm."""
    y_nm: float | None
    """Component up, nm."""


@dataclass(frozen=True, kw_only=True)
class LineResult(Document):
    """What one line direction of a frame gave."""

    candidates: tuple[CandidateResult, ...]
    """The lattices that were compared: the one that was measured, then the others, those that predict most
    first.
    """
    comparison: tuple[LatticeVector, LatticeVector, LatticeVector] | None
    """The same by the other estimator."""
    from_sensors: bool
    """Whether position sensors placed the pixels."""
    lattice_model: str
    """What describes the lattice there: `constant`, or a mean of one that changes: `even` (wave vectors
    change in proportion to the place), `cubic` (phases are cubic polynomials) or `smooth`.
    """
    line: str
    """`trace` or `retrace`."""
    origin_nm: tuple[float | None, float | None]
    """Position of pixel (0, 0), the bottom left one, nm."""
    periods: float | None
    """Lattice periods across the shorter side."""
    pixel_to_nm: tuple[tuple[float | None, float | None], tuple[float | None, float | None]]
    """Linear part of the map (column, row) → (x, y), nm per pixel, row by row."""
    predicted_by: float | None
    """By how many standard errors the weakest of the three waves improves the prediction of parts of the
    frame that were held out.
    """
    rivals: int | None
    """How many waves of about the same period beside the lattice are as strong as its weakest one; three
    could make another lattice.
    """
    second_wavelengths_nm: tuple[float | None, float | None, float | None] | None
    """Of a second lattice on top of it, which was measured with it: lengths of its three shortest vectors as
    those of `candidates`.
    """
    share_covered: float | None
    """Share of the frame that carries the lattice and was measured."""
    shortcut_wavelengths_nm: tuple[float | None, float | None, float | None] | None
    """The published shortcut 4π/(√3|K|) of the three first wave vectors, nm: right only for undistorted
    hexagons, for comparison.
    """
    signal_to_noise: float | None
    """Amplitude of the weakest first harmonic over its noise."""
    vectors: tuple[LatticeVector, LatticeVector, LatticeVector]
    """The three vectors in sensor coordinates."""


@dataclass(frozen=True, kw_only=True)
class MapDetailsResult(Document):
    """What was asked of a map."""

    devices: tuple[DeviceResult, ...]
    """The most uniform areas of the wanted size, best first."""
    domains: DomainsResult | None
    """Domain structure, where it was looked for and found."""
    grains: tuple[RegionResult, ...] = ()
    """Grains that lie side by side; they have no corners, and their area is that of their good nodes."""
    pattern: PatternResult | None = None
    """The pattern of the first image: undistorted, and its averaged cell; nothing where phases are not
    followed.
    """
    regime: RegimeResult | None
    """Whether the maps or the triangles are to be used."""
    regions: tuple[RegionResult, ...]
    """Boxes and polygons."""
    registry: RegistryResult | None = None
    """What the registry of the layers in `displacement.csv` and `map.zarr` counts from."""
    wanted: WantedResult | None
    """How much of the map has the wanted twist."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class MapResults(MapBase):
    """What a map comes to."""

    agreement: AgreementResult | None
    """How images of one place agree."""
    caveats: tuple[Caveat, ...]
    """Doubts."""
    conventions: Conventions
    """What the numbers mean."""
    details: MapDetailsResult
    """Regions, uniform areas, wanted twist."""
    drift_change: DriftChangeResult | None
    """Difference between upward and downward frames along the slow axis: a drift that changes, not strain."""
    errors: str
    """What the errors of the maps are and what they leave out."""
    extent_nm: tuple[tuple[float, float], tuple[float, float]]
    """From where to where the nodes reach, half a step beyond the outer ones: along x and along y, nm."""
    images: tuple[MappedImage, ...]
    """The images behind the map."""
    masks: tuple[MaskCount, ...]
    """Nodes by mask."""
    method: str
    """How the map was made: `demodulation` or `tiles`."""
    nodes: tuple[int, int]
    """Columns and rows of nodes."""
    origin_nm: tuple[float, float]
    """Node (0, 0), nm."""
    provenance: Provenance
    """Program, seed, inputs."""
    quantities: tuple[QuantityResult, ...]
    """Mean and spread of every quantity over the good nodes."""
    resolution_nm: float
    """Resolution: full width at half maximum of the window, nm."""
    schema: str
    """Name and version of this document."""
    settings: Settings
    """The settings of the analysis."""
    step_nm: tuple[tuple[float, float], tuple[float, float]]
    """The way to the next node in a row, and to the next row, nm."""
    stripes: StripesResult | None = None
    """Patterns of stripes, in a map of stripes: such a map has no twist and no strain."""
    whole_image: TwistStrainResult | None
    """The fit to the whole images, to compare with."""
    window_nm: float
    """Width of the window, standard deviation of the Gaussian, nm."""


@dataclass(frozen=True, kw_only=True)
class MappedImage(Document):
    """One image behind a map."""

    drift_corrected: bool
    """Whether its drift is taken off."""
    file: str
    """The file as the user named it."""
    harmonics: tuple[HarmonicResult, ...]
    """The harmonics that were used."""
    line: str
    """`trace` or `retrace`."""
    ruler: MappedRuler | None = None
    """What the atoms of a layer measured in place of the scanner; left out without."""


@dataclass(frozen=True, kw_only=True)
class Mask(Document):
    """Which pixels of a frame are used."""

    columns: int
    """Samples in a line."""
    rows: int
    """Lines."""
    runs: tuple[int, ...]
    """Row by row from the bottom: how many pixels are left out, then how many are used, and so on in turn."""


@dataclass(frozen=True, kw_only=True)
class MaskCount(Document):
    """How many nodes have a mask."""

    name: str
    """What it means."""
    nodes: int
    """Nodes."""
    value: int
    """Its number in the files."""


@dataclass(frozen=True, kw_only=True)
class MaskShare(Document):
    """Share of nodes with a mask."""

    percent: float
    """Share, %."""
    reason: str
    """The reason."""


@dataclass(frozen=True, kw_only=True)
class Material(Document):
    """An atomic layer."""

    cell_angle_deg: float | None = None
    """Angle γ between the two lattice vectors, degrees; goes with `lattice_constant_b_nm`."""
    lattice_constant_b_nm: float | None = None
    """Second lattice constant b, nm; without it the layer is hexagonal."""
    lattice_constant_nm: float
    """Lattice constant a, nm."""
    lattice_constant_sigma_nm: float
    """Standard uncertainty of the lattice constant, nm."""
    name: str
    """Name, as in `graphene`."""
    poisson_ratio: float
    """Poisson ratio ν: a stretch ε along an axis shrinks the layer by νε across it."""
    poisson_ratio_sigma: float
    """Standard uncertainty of the Poisson ratio."""
    source: str
    """Where the numbers come from."""


@dataclass(frozen=True, kw_only=True)
class MeanCellResult(Document):
    """The averaged cell."""

    bins: int
    """Bins along each vector."""
    cells: int
    """Moiré cells of the image with pixels in it."""
    pixels: int
    """Pixels that were averaged."""
    sigma: float | None
    """Root mean square of the standard errors of the bins, unit of the channel."""


@dataclass(frozen=True, kw_only=True)
class MeanResult(Document):
    """One lattice for several scans."""

    budget: BudgetResult
    """What contributes to their uncertainty, calibration and model included."""
    chi2_per_dof: float | None
    """χ² per degree of freedom of the scans against this lattice. Where it is significantly above 1 (p <
    0.05), every σ of this object is enlarged by its square root.
    """
    drift_assumed: AssumedDriftResult | None
    """What was assumed of a drift that the scans do not tell; `null` where it was measured or given."""
    heterostrain_percent: Estimate
    """Magnitude of the uniaxial heterostrain with the noise bias removed, per cent."""
    heterostrain_sigma_unscaled_percent: float | None
    """σ of the heterostrain before it was enlarged by √(χ²/dof), per cent."""
    lattice_angle_deg: Estimate
    """Orientation of layer 1, degrees in [0, 60)."""
    readings: ReadingsResult
    """What else the lattice can mean."""
    strain_axis_lab_deg: Estimate | None
    """Axis of the strain in the laboratory, degrees in [0, 180); `null` unless significant."""
    strain_axis_lattice_deg: Estimate | None
    """Axis of the strain from layer 1, degrees in [0, 180); `null` unless significant."""
    strain_interval_95_percent: tuple[float | None, float | None]
    """The interval that holds the magnitude of the strain with 95 % confidence, or more, per cent; it begins
    at 0 where noise alone may explain the strain.
    """
    strain_p_value: float | None
    """Probability that noise alone gives such a strain vector."""
    strain_scatter_percent: float | None
    """Root-mean-square deviation per component of the strain vector over the scans, per cent."""
    strain_upper_limit_95_percent: float | None
    """Upper limit of the magnitude of the strain, 95 % confidence, per cent."""
    strain_vector_covariance: tuple[tuple[float | None, float | None], tuple[float | None, float | None]]
    """Covariance of the strain vector, per cent²."""
    strain_vector_percent: tuple[float | None, float | None]
    """(ε cos 2φ, ε sin 2φ) with φ the axis in the laboratory, per cent. Average this, not the magnitude."""
    strain_vector_sigma_total_percent: tuple[float | None, float | None] | None = None
    """One standard deviation of each component with everything, calibration and model included, per cent; as
    `sigma_total` of the others.
    """
    twist_deg: Estimate
    """Twist of layer 2 against layer 1, degrees."""
    twist_scatter_deg: float | None
    """Standard deviation of the twist over the scans, degrees."""
    twist_sigma_unscaled_deg: float | None
    """σ of the twist before it was enlarged by √(χ²/dof), degrees."""
    vectors: tuple[LatticeVector, LatticeVector, LatticeVector]
    """L1, L2 and L3."""
    within_one_percent: bool
    """Whether the wavelengths of every scan lie within ±1 % of these."""


@dataclass(frozen=True, kw_only=True)
class MoireLayers(Document):
    """The layers of one of several moirés."""

    material: Material
    """Both layers, or the upper one (layer 2) where there is a `substrate`."""
    ruler: RulerLayer | None = None
    """The layer of this moiré whose atoms the frames show; `None`: as for all of them."""
    substrate: Material | None = None
    """The lower layer (layer 1, the reference) where it is another one."""


@dataclass(frozen=True, kw_only=True)
class NameResult(Document):
    """One name of a lattice."""

    standing: str
    """`reported`, `open` (as plausible as the reported one), `against-image`, `against-orientation` or
    `unlikely` (much strain).
    """
    strain_percent: float
    """The strain of its first solution with θ > 0."""
    twist_deg: float
    """The twist of this solution."""
    waves: tuple[tuple[int, int], tuple[int, int]]
    """As of the solutions."""


@dataclass(frozen=True, kw_only=True)
class NamedSet(Document):
    """A set made by hand: all files under a path."""

    name: str
    """Its name."""
    path: str
    """A folder or a file."""


@dataclass(frozen=True, kw_only=True)
class NamesResult(Document):
    """The names of a lattice and the choice among them."""

    chosen_by: str
    """What chose the reported name: `image` (every other plausible name has a wave that is too weak),
    `orientation` (the others need isotropic strain), `user`, or `least-strain` (none of these).
    """
    names: tuple[NameResult, ...]
    """The reported name first."""


@dataclass(frozen=True, kw_only=True)
class OtherSenseResult(Document):
    """The solution for θ < 0 where the sense of the twist is open."""

    axis_lab_deg: Estimate | None
    """φ, in [0, 180); `null` unless γ is significant."""
    covariance: tuple[tuple[float | None, float | None, float | None, float | None, float | None], tuple[float | None, float | None, float | None, float | None, float | None], tuple[float | None, float | None, float | None, float | None, float | None], tuple[float | None, float | None, float | None, float | None, float | None], tuple[float | None, float | None, float | None, float | None, float | None]]
    """Covariance of (twist, lattice angle, mean strain, shear₁, shear₂) in degrees and per cent."""
    lattice_angle_deg: Estimate
    """Orientation of layer 1."""
    mean_strain_percent: Estimate
    """½(ε₁ + ε₂)."""
    shear_percent: Estimate
    """γ = ½(ε₁ − ε₂), the noise bias removed."""
    shear_vector_percent: tuple[float | None, float | None]
    """γ (cos 2φ, sin 2φ), φ the axis of ε₁ in the laboratory."""
    splits: tuple[SplitResult, SplitResult]
    """Its uniaxial and isotropic part."""
    total: TensorSigmas
    """σ of the same with calibration and lattice constants as well."""
    twist_deg: Estimate
    """Twist of layer 2 against layer 1."""
    twist_interval_deg: tuple[float | None, float | None]
    """Range of the magnitude of the twist from both solutions, with 1.96 σ of `total` on either side."""


@dataclass(frozen=True, kw_only=True)
class PatternResult(Document):
    """The pattern of one image as its map shows it."""

    cell: MeanCellResult | None
    """The averaged cell; nothing where fewer than two cells of the image are known."""
    channel: str
    """The channel."""
    drift_corrected: bool
    """Whether the drift is taken off."""
    file: str
    """The file as the user named it."""
    lattice_vectors_nm: tuple[tuple[float, float], tuple[float, float]]
    """L₁ and L₂ of the mean lattice, nm."""
    line: str
    """`trace` or `retrace`."""
    node_nm: tuple[float, float]
    """A node of the mean lattice, nm: corners of the averaged cell are such nodes."""
    nodes_are: str
    """`bright` or `dark`: what the nodes are."""
    undistorted: UndistortedResult
    """The image with the displacement of its pattern taken off. Resampled to be shown: nothing is measured
    from it.
    """
    unit: str
    """Its unit."""


@dataclass(frozen=True, kw_only=True)
class Provenance(Document):
    """What is needed to make the numbers again."""

    failed: tuple[FailedInput, ...]
    """The files that were given but could not be used."""
    inputs: tuple[InputFile, ...]
    """The files that were analysed, in order."""
    run: Run | None = None
    """What was asked, for a repetition."""
    seed: int
    """Seed of all random numbers."""
    version: str
    """Version of the program."""


@dataclass(frozen=True, kw_only=True)
class QuantityResult(Document):
    """Mean and spread of a quantity over the good nodes."""

    bends: float | None = None
    """What bends of the grid that no sensor told may add to the nodes, root mean square; in no other number,
    and left out where it is not known.
    """
    mean: float
    """Mean."""
    mean_sigma: float
    """Standard error of the mean by image noise; an upper limit of it for the size of the strain and
    displacements.
    """
    name: str
    """Its name in the files."""
    noise: float
    """Root mean square of the errors of the nodes."""
    spread: float
    """Standard deviation over the nodes."""
    spread_corrected: float
    """The same with the noise taken off."""
    trend: TrendResult | None = None
    """A plane through the good nodes; `null` where they are too few or too near to each other."""
    unit: str
    """Its unit."""


@dataclass(frozen=True, kw_only=True)
class ReadingsResult(Document):
    """Everything that a lattice can mean besides `twist_deg` and `heterostrain_percent`."""

    isotropic_strain: IsotropicStrainResult | None
    """What an isotropic heterostrain does to the twist; `null` where no solution is exact."""
    layers_differ: bool
    """Whether the layers differ. Then several pairs of twist and strain explain the moiré: every entry of
    `solutions` with `twist_deg` > 0 and the waves of the first fits equally well.
    """
    names: NamesResult | None
    """The names of the lattice, that is which of its waves belong to the atoms, and the choice among them;
    `null` for layers of dissimilar lattices.
    """
    solutions: tuple[SolutionResult, ...]
    """Every exact solution with uniaxial strain alone, under every name of the lattice: those of the reported
    name first, then the least strained names.
    """
    solutions_complete_to_percent: float
    """`solutions` holds all solutions with at most this strain."""
    strain_tensor: StrainTensorResult | None
    """Twist and the whole relative strain; `null` unless the orientation of a layer is known."""


@dataclass(frozen=True, kw_only=True)
class RegimeResult(Document):
    """Which regime applies."""

    blurred_percent: float | None
    """Share of inner nodes of the map that are bent or defects, %."""
    phase_map_in_doubt: bool
    """Whether the phase map is in doubt."""
    reasons: tuple[str, ...]
    """Why."""
    use_of: str
    """`phase map` or `domains` (the triangles between nodes): what is to be used."""
    variation_percent: float | None
    """Change of the area of cells over the width of the window, %."""


@dataclass(frozen=True, kw_only=True)
class RegionMeanResult(Document):
    """Mean and spread of a quantity over an area."""

    blur: float | None
    """Shift of the mean by smoothing with the window, from the curvature of the map."""
    mean: float | None
    """Mean over the area of the good nodes."""
    noise: float | None
    """Root mean square of the errors of the nodes."""
    sigma: float | None
    """Its standard error from image noise (neighbouring nodes are correlated) and from `blur`. Errors that
    all nodes share (drift, calibration, lattice constant, model) are not included.
    """
    spread: float | None
    """Standard deviation over the nodes."""
    spread_below_95: float | None
    """Upper limit of the spread (95 %), with noise and smoothing (`spread_widening`) taken into account. It
    holds where the lattice changes over eight windows or more; for shorter changes it may be too small.
    """
    spread_corrected: float | None
    """The same without what noise adds."""
    spread_widening: float | None
    """Factor by which smoothing with the window may have reduced the spread, from the curvature of the map.
    """


@dataclass(frozen=True, kw_only=True)
class RegionResult(Document):
    """A region in numbers."""

    area_nm2: float
    """Area, nm²."""
    corners_nm: tuple[tuple[float, float], ...]
    """Corners in order, nm."""
    covered_percent: float
    """Share of the area that the map covers, %."""
    good_nodes: int
    """Good nodes."""
    masked_by_percent: tuple[MaskShare, ...]
    """Masked nodes by reason, % of the nodes within."""
    masked_percent: float
    """Share of masked nodes, %."""
    mean: TwistStrainResult | None
    """Twist and strain of the mean of the region."""
    name: str
    """Its name."""
    nodes: int
    """Nodes whose cells the area covers at least in part."""
    strain_rms_percent: float | None
    """Root mean square of the local strain without noise, %."""
    strain_vector_percent: tuple[RegionMeanResult, RegionMeanResult] | None
    """Components of the strain vector, %."""
    twist_deg: RegionMeanResult | None
    """Twist, degrees."""
    wavelength_nm: RegionMeanResult | None
    """Mean wavelength, nm."""


@dataclass(frozen=True, kw_only=True)
class RegistryResult(Document):
    """The registry of the layers: what its numbers in `displacement.csv` and `map.zarr` count from."""

    convention: str
    """What it is, and how signs and zero are chosen."""
    layer_1_vectors_nm: tuple[tuple[float, float], tuple[float, float]]
    """Atomic vectors a₁ and a₂ of layer 1 (A as columns), nm."""
    moire_vectors_nm: tuple[tuple[float, float], tuple[float, float]]
    """Moiré vectors of the same names (L as columns), nm: along each the registry changes by minus one vector
    of layer 1.
    """
    nodes: int
    """Nodes of the map where it is known."""
    sigma_nm: float | None
    """Root mean square error of a component, nm."""
    zero_is: str
    """`bright` or `dark`: what that node is."""
    zero_nm: tuple[float, float]
    """r₀, the node of the pattern where the registry is zero, nm."""


@dataclass(frozen=True, kw_only=True)
class ResidualResult(Document):
    """How a scan lies against the fit of all others of its set."""

    chi2: float | None
    """χ² of its wave vectors and phases against what the others predict."""
    degrees_of_freedom: int
    """Degrees of freedom of `chi2`."""
    displacement_nm: tuple[float | None, float | None] | None
    """Distance of the lattice from the place that the other scans predict, x and y; `null` without linked
    phases.
    """
    outlying: bool
    """Whether it stands out: `p_value` < 0.001 divided by the number of scans."""
    p_value: float | None
    """Probability of so large a χ² by chance, relative to that of the other scans if this exceeds 1."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Results(ResultsBase):
    """Everything that was found, in degrees, per cent, nm and nm/min."""

    atomic: AtomicResult | None
    """The orientation of a layer by atomically resolved images; `null` without any."""
    caveats: tuple[Caveat, ...]
    """Doubts."""
    combined: CombinedResult | None
    """All sets together; `null` where the drift of several sets is known of none."""
    conventions: Conventions
    """What the numbers mean."""
    failed: tuple[FailedInput, ...]
    """Inputs that could not be used."""
    provenance: InputProvenance
    """Program, seed and inputs."""
    schema: str
    """`moiregauge/results/1`."""
    sets: tuple[SetResult, ...]
    """The sets, in order of time."""
    settings: Settings
    """The settings as they were used."""


@dataclass(frozen=True, kw_only=True)
class RulerCalibration(Document):
    """The scanner by the atoms of a layer: lengths in the image are `F` times the true ones."""

    gain_percent: Estimate
    """By how much lengths are too long, mean of x and y, per cent."""
    mismatch_percent: Estimate
    """By how much lengths along x are too long compared with y, per cent."""
    orthogonality_mrad: Estimate
    """A right angle minus the angle between the axes in the image, mrad."""


@dataclass(frozen=True, kw_only=True)
class RulerResult(Document):
    """A set measured by the atoms of one of its layers."""

    calibration: RulerCalibration | None
    """The scanner at the drift of the set, which is given, measured or assumed; `null` without timing."""
    drift_nm_per_min: tuple[Estimate, Estimate] | None
    """Drift to the right and up that goes with it, if both axes have this gain and stand at a right angle,
    nm/min; `null` without timing.
    """
    fast_gain: Estimate
    """What the scanner shows over what it is, along the fast axis."""
    layer: int
    """Layer 1, the reference, or layer 2."""
    lines: int
    """Traces and retraces that show its atoms."""
    mean: MeanResult
    """Twist and strain of layer 2 against layer 1, free of drift and of the calibration of the scanner."""
    used: bool
    """Whether `mean` of the set is by the atoms."""


@dataclass(frozen=True, kw_only=True)
class Run(Document):
    """A run of the program: what a repetition needs beside the files themselves."""

    arguments: tuple[str, ...]
    """The arguments as they were typed, the command first; what cannot change results is left out: where they
    go, how many threads, what is printed.
    """
    atomic: AtomicImages | None = None
    """Images in which the orientation of a layer was to be measured."""
    command: str
    """`analyze` or `map`."""
    export: tuple[str, ...] = ()
    """Names of corrected images that were wanted."""
    inputs: tuple[str, ...]
    """The files to measure as they were named, in order, those that could not be used among them."""
    known: UserSpecified
    """What the user said about the files."""
    left_out: tuple[FailedInput, ...] = ()
    """Names that were given and not measured: no file, or one that could not be read."""
    other_files: tuple[InputFile, ...] = ()
    """Files that were read and are not in `provenance.inputs`: those that could not be used, position
    sensors, logs of sessions.
    """
    parquet: bool
    """Whether the tables were wanted as Parquet, too."""
    report: Choice
    """Which parts of the report were wanted."""
    sets: tuple[NamedSet, ...] = ()
    """Sets made by hand."""
    settings: Settings
    """The settings that were asked for: before a channel was chosen or an orientation measured."""
    survey_image: str | None = None
    """An image of a larger area to mark the scans in."""


@dataclass(frozen=True, kw_only=True)
class ScanResult(Document):
    """One frame."""

    acquired: str | None
    """When it was saved, by the instrument's clock, as in `2024-05-17T14:03:09`."""
    excluded: str | None
    """Why it was not used for the results of its set; `null` where it was."""
    file: str
    """The file as the user named it."""
    frame_direction: str
    """`up`: the bottom line was acquired first; `down`: the top line; `unknown`."""
    lines: tuple[LineResult, ...]
    """The line directions that were used."""
    monte_carlo: StrainMonteCarlo | None
    """Mean and spread of the Monte Carlo draws behind the best of `twist_strain`."""
    residual: ResidualResult | None
    """How it agrees with the other scans; `null` without a joint fit."""
    tip_velocity_nm_per_s: TipVelocity
    """Speed of the tip, nm/s; σ is the spread over the lines."""
    twist_strain: ScanTwistStrain
    """Twist and strain before and after the drift was removed."""
    vectors: tuple[ScanVector, ScanVector, ScanVector]
    """The three lattice vectors."""
    window: Window
    """Where the tip was."""


@dataclass(frozen=True, kw_only=True)
class ScanTwistStrain(Document):
    """Twist and strain of a scan."""

    drift_corrected: TwistStrainResult | None
    """With the drift removed."""
    sensor: TwistStrainResult | None
    """From sensor coordinates."""


@dataclass(frozen=True, kw_only=True)
class ScanVector(Document):
    """One lattice vector in three kinds of coordinates."""

    drift_corrected: LatticeVector | None
    """By the position sensors, the drift removed."""
    name: str
    """`L1`, `L2` or `L3`."""
    nominal: LatticeVector | None
    """By the nominal size of the scan."""
    polar_angle_deg: float | None
    """Direction by the best coordinates there are, degrees counter-clockwise from x."""
    sensor: LatticeVector
    """By the position sensors."""


@dataclass(frozen=True, kw_only=True)
class ScannerCalibration(Document):
    """A measured calibration: lengths in the image are `F` times the true ones, see [`crate::calibration`].
    """

    coordinates: Coordinates
    """Whether it is that of position sensors."""
    covariance: tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]
    """Covariance of the three, in their units."""
    curvature: Curvature | None = None
    """How position sensors bend; `None` where no bend was seen."""
    gain_percent: float
    """s: by how much lengths in the image are too long, mean of x and y, per cent."""
    line_rates_hz: tuple[float, ...]
    """Line rates of those frames, Hz."""
    mismatch_percent: float
    """g: by how much lengths along x are too long compared with y, per cent."""
    orthogonality_mrad: float
    """γ: a right angle minus the angle between the axes in the image, mrad."""
    sizes_nm: tuple[tuple[float, float], ...]
    """Sizes of the frames it was measured with, nm (fast, slow)."""


@dataclass(frozen=True, kw_only=True)
class ScatterResult(Document):
    """One standard deviation of each quantity."""

    drift_nm_per_min: tuple[float | None, float | None]
    """Of the drift, x and y."""
    strain_vector_percent: tuple[float | None, float | None]
    """Of the components of the strain vector."""
    twist_deg: float | None
    """Of the twist."""


@dataclass(frozen=True, kw_only=True)
class SetLatticeResult(Document):
    """The lattice of a set that no twist and strain explain: of atoms, of a surface, of other layers."""

    chi2_per_dof: float | None
    """χ² per degree of freedom of the scans against this lattice. Where it is significantly above 1 (p <
    0.05), every σ of this object is enlarged by its square root.
    """
    drift_assumed: AssumedDriftResult | None
    """What was assumed of a drift that the scans do not tell; `null` where it was measured or given."""
    vectors: tuple[LatticeVector, LatticeVector, LatticeVector]
    """L1, L2 and L3, corrected for drift where the set has one."""
    wavelength_scatter_nm: tuple[float | None, float | None, float | None]
    """Standard deviations of the three lengths over the scans, nm."""


@dataclass(frozen=True, kw_only=True)
class SetResult(Document):
    """Scans of one slow axis, line rate, size and channel."""

    by_scanner: MeanResult | None = None
    """`mean` by the scanner alone, where that is by the atoms of a layer and the scanner alone gives one."""
    channel: str
    """The analysed channel."""
    checks: ChecksResult | None
    """Errors from the scatter of the scans; `null` without a joint fit."""
    drift: DriftResult | None
    """The drift; `null` where the scans cannot determine it: then one is assumed, see `drift_assumed` of
    `mean`.
    """
    forward_backward: TwistStrainResult | None
    """From the mean reciprocal lattice of up and down scans: free of constant drift without knowing it. A
    check of `mean`.
    """
    lattice: SetLatticeResult | None
    """The lattice of all scans together, where no twist and strain explain it; `null` where they do, and
    where it may be another one.
    """
    line_rate_hz: float | None
    """Lines per second (trace and retrace together)."""
    mean: MeanResult | None
    """All scans together, corrected for drift, or with an assumed drift in the errors."""
    name: str
    """Name for people, unique in the document."""
    ruler: RulerResult | None = None
    """By the atoms of a layer that the scans show beside the moiré; left out where they do not."""
    scans: tuple[ScanResult, ...]
    """The scans in order of time."""
    slow_axis: str
    """`x` or `y`: the axis along which lines follow each other."""
    uncorrected: MeanResult | None
    """The plain mean over the scans, not corrected for drift."""


@dataclass(frozen=True, kw_only=True)
class Settings(Document):
    """Every knob of an analysis."""

    background: Background
    """What is subtracted beforehand."""
    by_hand: ByHand | None = None
    """Choices made by hand: which lattice to measure, and where it is."""
    calibration: Calibration
    """How well the scanner is calibrated, for the uncertainty budget."""
    channel: str | None
    """Channel that shows the moiré; `None`: the first of the usual ones that is present."""
    drift: GivenDrift | None
    """A drift known beforehand; `None`: measure it."""
    drift_draws: int
    """Monte Carlo draws for the drift."""
    drift_prior_nm_per_min: float
    """Standard deviation of each component of the drift where scans do not tell it and `drift` is not given,
    nm/min, for the uncertainty budget. The default is what an instrument at rest drifts; where a frame is
    so slow that this would be more than a quarter of the speed at which its lines advance, that quarter is
    taken.
    """
    exclude: tuple[str, ...]
    """Scans that are shown but not used: names of files, `*` stands for any characters."""
    exclude_outliers: bool
    """Whether scans that do not fit the others are left out by themselves: one after the other, worst first,
    while the leave-one-out χ² of a scan has p < 0.001/n; never more than a fifth.
    """
    frame_time_sigma_s: float
    """Standard uncertainty of the time of a frame, s: headers hold whole seconds (0.29 s) and are written
    some time after the end of the frame.
    """
    grain: int | None = None
    """Which grain to use of scans that show several, as their sets are named: `grain 1` is number 1; `None`:
    each is a set of its own.
    """
    grouping: Grouping
    """How files become sets."""
    image: int | None = None
    """Which of several images of the channel in one file, counted from 1; `None`: the first."""
    isotropic_strain_percent: float
    """Standard deviation of the isotropic heterostrain that the layers may have beside the uniaxial one, per
    cent, for the uncertainty budget. The moiré does not show it. The default is a guess, of the size of
    small uniaxial strains; up to 0.06 % the twist stays within 0.001°.
    """
    lattice_angle: KnownOrientation | None = None
    """The orientation of one of the layers, if it is known: tells isotropic strain from twist."""
    lattice_angle_2: KnownOrientation | None = None
    """The orientation of the other layer, if it is known as well: tells the sense of the twist of equal
    layers.
    """
    layers_chosen: bool
    """Whether the user chose the layers; otherwise a caveat says that they were assumed."""
    line: Lines
    """Line directions to use."""
    material: Material
    """The layers: both, or the upper one (layer 2) where there is a `substrate`."""
    method: Method
    """Estimator of the lattice vectors."""
    moire_layers: tuple[MoireLayers, ...] = ()
    """The layers of each moiré, the largest cell first, where not all moirés are of the same; they take the
    place of `material` and `substrate`.
    """
    moire_waves: tuple[tuple[float, float], tuple[float, float]] | None = None
    """Two wave vectors of the moiré, x and y in rad/nm, that belong to the reciprocal vectors of the atoms at
    0° and (hexagonal layers) 120°; about will do. The lattice of a strained moiré has other pairs that can
    be meant; without this, image and orientation choose where they can, and else the least strain.
    """
    moires: int
    """How many moirés every image shows; each is fitted after the others are subtracted."""
    overlap: bool
    """Use only the region that all scans of a set have in common."""
    ruler: RulerLayer
    """The layer whose atoms the frames show beside the moiré and which measures them in place of the scanner.
    Of several moirés, which need not have this layer in common, only where it is said.
    """
    ruler_magnification_percent: float
    """Standard deviation of the change of the gain along x and along y between the frames of `ruler_from` and
    the scans, per cent, for the uncertainty budget. The default is that of open piezo tubes whose frames
    differ by a twentieth of their range: their sensitivity grows with the voltage, by some 10 % from the
    smallest to the full range.
    """
    ruler_strain_percent: float
    """Standard deviation of the strain that this layer itself may have, along x and along y, per cent, for
    the uncertainty budget.
    """
    scanner: ScannerCalibration | None = None
    """A measured calibration of the scanner: positions are corrected with it, and its covariance takes the
    place of `calibration` in the budget.
    """
    seed: int
    """Seed of all random numbers."""
    strain_convention: StrainConvention
    """Form of the strain equation."""
    strain_draws: int
    """Monte Carlo draws for twist and strain, per scan."""
    substrate: Material | None = None
    """The lower layer (layer 1, the reference) where it is another one."""
    twist_sense: TwistSense | None = None
    """The sense of the twist, if it is known: an orientation of one of two equal layers leaves it open."""


@dataclass(frozen=True, kw_only=True)
class ShiftResult(Document):
    """One isotropic strain."""

    isotropic_strain_percent: float
    """The strain of layer 2, the same in all directions."""
    twist_change_deg: float | None
    """The change of the twist; `null` where no twist explains the moiré."""


@dataclass(frozen=True, kw_only=True)
class SolutionResult(Document):
    """One exact solution: σ from image noise, drift and sensor noise."""

    lattice_angle_deg: float | None
    """Orientation of layer 1."""
    strain_axis_lab_deg: float | None
    """Axis of the strain in the laboratory, in [0, 180)."""
    strain_dominated: bool
    """Whether the moiré is read as made by strain and distorted by twist."""
    strain_percent: Estimate
    """Uniaxial strain with its sign."""
    twist_deg: Estimate
    """Twist of layer 2 against layer 1."""
    waves: tuple[tuple[int, int], tuple[int, int]]
    """Which waves of the lattice belong to the reciprocal vectors of the atoms at 0° and 120°: `[[h₁, k₁],
    [h₂, k₂]]` means `h₁ K₁ + k₁ K₂` and `h₂ K₁ + k₂ K₂`, with `K_i · L_j = 2π δ_ij` for the L₁ and L₂ that
    are reported.
    """


@dataclass(frozen=True, kw_only=True)
class SplitResult(Document):
    """Uniaxial and isotropic part; σ as of `total`."""

    axis_lab_deg: Estimate | None
    """Axis of the uniaxial part in the laboratory."""
    biaxial_percent: Estimate
    """The isotropic strain added to it."""
    uniaxial_percent: Estimate
    """Along the axis; −ν times this across."""


@dataclass(frozen=True, kw_only=True)
class StrainMonteCarlo(Document):
    """Mean and spread of the Monte Carlo draws of twist and strain."""

    draws: int
    """Number of draws."""
    lattice_angle_deg: Estimate
    """Orientation of layer 1, degrees."""
    strain_vector_covariance: tuple[tuple[float | None, float | None], tuple[float | None, float | None]]
    """Covariance of the drawn strain vectors, per cent²."""
    strain_vector_percent: tuple[float | None, float | None]
    """Mean strain vector, per cent."""
    twist_deg: Estimate
    """Twist, degrees."""


@dataclass(frozen=True, kw_only=True)
class StrainTensorResult(Document):
    """Twist and the whole strain of layer 2 against layer 1, of atoms, tension positive."""

    alternatives: tuple[TensorNumbers, ...]
    """Other solutions of the same orientation with less than 1 % of mean strain."""
    axis_lab_deg: Estimate | None
    """φ, in [0, 180); `null` unless γ is significant."""
    covariance: tuple[tuple[float | None, float | None, float | None, float | None, float | None], tuple[float | None, float | None, float | None, float | None, float | None], tuple[float | None, float | None, float | None, float | None, float | None], tuple[float | None, float | None, float | None, float | None, float | None], tuple[float | None, float | None, float | None, float | None, float | None]]
    """Covariance of (twist, lattice angle, mean strain, shear₁, shear₂) in degrees and per cent."""
    lattice_angle_deg: Estimate
    """Orientation of layer 1."""
    mean_strain_percent: Estimate
    """½(ε₁ + ε₂)."""
    other_sense: OtherSenseResult | None
    """For two equal layers whose sense of twist is open: the solution for the other sense, which fits equally
    well; `null` otherwise.
    """
    shear_percent: Estimate
    """γ = ½(ε₁ − ε₂), the noise bias removed."""
    shear_vector_percent: tuple[float | None, float | None]
    """γ (cos 2φ, sin 2φ), φ the axis of ε₁ in the laboratory."""
    splits: tuple[SplitResult, SplitResult]
    """The strain as uniaxial and isotropic part: tension along the axis, and compression across it."""
    total: TensorSigmas
    """σ of the same with calibration and lattice constants as well."""
    twist_deg: Estimate
    """Twist of layer 2 against layer 1."""


@dataclass(frozen=True, kw_only=True)
class StripeHarmonicResult(Document):
    """A harmonic of a pattern."""

    amplitude: float
    """Amplitude in the fit to all pixels of the pattern, unit of the image."""
    local_amplitude: float
    """Amplitude under the window, root mean square where the pattern is."""
    order: int
    """1 for the wave itself, 2 for half its wavelength, …."""


@dataclass(frozen=True, kw_only=True)
class StripePatternResult(Document):
    """A pattern of stripes."""

    coherence_percent: float | None
    """Share of the local power of the pattern that the one wave has, per cent: 100 for straight stripes."""
    direction_deg: Estimate | None
    """Direction along its stripes by the same fit, degrees."""
    good_nodes: int
    """Good nodes."""
    harmonics: tuple[StripeHarmonicResult, ...]
    """The harmonics of the fit."""
    log10_chance: float
    """log₁₀ of the chance that noise makes the pattern."""
    map: tuple[QuantityResult, ...]
    """Wavelength and direction of the map over its good nodes."""
    number: int
    """Its number, from 1."""
    share_percent: float
    """Share of the nodes where it is the strongest, per cent."""
    wavelength_nm: Estimate | None
    """Wavelength of one wave with overtones fitted to all its pixels, nm; its error is by what the fit
    leaves.
    """


@dataclass(frozen=True, kw_only=True)
class StripesResult(Document):
    """A map of stripes: patterns with one wave vector each, which say nothing of twist and strain."""

    patterns: tuple[StripePatternResult, ...]
    """The patterns, strongest first; `stripes` in the files has their numbers."""


@dataclass(frozen=True, kw_only=True)
class TensorNumbers(Document):
    """Twist and strain tensor."""

    axis_lab_deg: Estimate | None
    """φ, in [0, 180); `null` unless γ is significant."""
    lattice_angle_deg: Estimate
    """Orientation of layer 1."""
    mean_strain_percent: Estimate
    """½(ε₁ + ε₂)."""
    shear_percent: Estimate
    """γ = ½(ε₁ − ε₂), the noise bias removed."""
    shear_vector_percent: tuple[float | None, float | None]
    """γ (cos 2φ, sin 2φ), φ the axis of ε₁ in the laboratory."""
    twist_deg: Estimate
    """Twist of layer 2 against layer 1."""


@dataclass(frozen=True, kw_only=True)
class TensorSigmas(Document):
    """Standard deviations."""

    axis_lab_deg: float | None
    """Of the axis; `null` where γ is not significant with these errors."""
    mean_strain_percent: float | None
    """Of the mean strain."""
    shear_percent: float | None
    """Of γ."""
    twist_deg: float | None
    """Of the twist."""


@dataclass(frozen=True, kw_only=True)
class TestedResult(Document):
    """A term that was tried."""

    criterion_gain: float | None
    """By how much it lowers the Bayesian information criterion; below 0 the term is not used."""
    term: str
    """`acceleration`, `settling` or `fast-axis gain`."""
    used: bool
    """Whether the fit has it."""


@dataclass(frozen=True, kw_only=True)
class TipVelocity(Document):
    """Tip velocities."""

    fast: Estimate
    """Along a line."""
    slow: Estimate
    """From line to line."""


@dataclass(frozen=True, kw_only=True)
class TrendResult(Document):
    """A plane through the good nodes: how much of the spread is a change across the frame (creep, drift that
    changes, a scanner that bows, or the sample).
    """

    middle: float
    """Value at the middle of the frame (of stripes: of the nodes of the pattern), where a fit to all its
    pixels has its mean.
    """
    middle_sigma: float
    """Its standard error by the noise of the image."""
    noise: float
    """Standard deviation due to noise."""
    of_trend: float
    """Standard deviation over the good nodes due to the plane."""
    per_100nm: tuple[float, float]
    """Change along x and along y, per 100 nm."""
    per_100nm_sigma: tuple[float, float]
    """Their standard errors by the noise of the image."""
    rest: float
    """Standard deviation that neither trend nor noise explains."""


@dataclass(frozen=True, kw_only=True)
class TwistStrainResult(Document):
    """Twist and heterostrain of one lattice."""

    heterostrain_percent: Estimate
    """Magnitude of the uniaxial heterostrain with the noise bias removed, per cent."""
    lattice_angle_deg: Estimate
    """Orientation of layer 1, degrees in [0, 60)."""
    strain_axis_lab_deg: Estimate | None
    """Axis of the strain in the laboratory, degrees in [0, 180); `null` unless significant."""
    strain_axis_lattice_deg: Estimate | None
    """Axis of the strain from layer 1, degrees in [0, 180); `null` unless significant."""
    strain_interval_95_percent: tuple[float | None, float | None]
    """The interval that holds the magnitude of the strain with 95 % confidence, or more, per cent; it begins
    at 0 where noise alone may explain the strain.
    """
    strain_p_value: float | None
    """Probability that noise alone gives such a strain vector."""
    strain_upper_limit_95_percent: float | None
    """Upper limit of the magnitude of the strain, 95 % confidence, per cent."""
    strain_vector_covariance: tuple[tuple[float | None, float | None], tuple[float | None, float | None]]
    """Covariance of the strain vector, per cent²."""
    strain_vector_percent: tuple[float | None, float | None]
    """(ε cos 2φ, ε sin 2φ) with φ the axis in the laboratory, per cent. Average this, not the magnitude."""
    strain_vector_sigma_total_percent: tuple[float | None, float | None] | None = None
    """One standard deviation of each component with everything, calibration and model included, per cent; as
    `sigma_total` of the others.
    """
    twist_deg: Estimate
    """Twist of layer 2 against layer 1, degrees."""


@dataclass(frozen=True, kw_only=True)
class UndistortedResult(Document):
    """The undistorted image."""

    known_percent: float
    """Share of its pixels that are not missing."""
    origin_nm: tuple[float, float]
    """Its bottom left pixel, nm."""
    pitch_nm: float
    """Distance of its pixels, nm."""
    pixels: tuple[int, int]
    """Columns and rows."""


@dataclass(frozen=True, kw_only=True)
class UserSpecified(Document):
    """What files do not tell and the user does."""

    crop: Crop | None = None
    """The block of the image to use."""
    frame_direction: FrameOrder | None = None
    """Sense of the slow motion."""
    line_rate_hz: float | None = None
    """Lines per second, trace and retrace together."""
    rotation_deg: float | None = None
    """Angle by which the fast axis is turned against x, degrees, counter-clockwise."""
    sensor_unit: str | None = None
    """Unit of the position sensors of arrays."""
    sensors: str | None = None
    """File that holds the position sensors."""
    size_nm: tuple[float, float] | None = None
    """Width and height of the image from edge to edge, nm."""
    unit: str | None = None
    """Unit of the values of arrays and pictures."""
    x_sensor: str | None = None
    """Channel that is the position sensor along x."""
    y_sensor: str | None = None
    """Channel that is the position sensor along y."""


@dataclass(frozen=True, kw_only=True)
class WantedResult(Document):
    """How much of a map has a wanted twist, % of the good nodes."""

    blur_percent: float | None
    """Shift of this share by smoothing with the window, from the curvature of the map."""
    certain_percent: float | None
    """Share of nodes that are within the limits by at least two of their σ."""
    corrected_percent: float | None
    """Share expected without noise."""
    measured_percent: float | None
    """Share of nodes whose measured twist is within the limits."""
    nodes: int
    """Good nodes."""
    possible_percent: float | None
    """Share of nodes that are not outside the limits by two of their σ."""
    twist_deg: float
    """The wanted twist, degrees."""
    within_deg: float
    """The allowed deviation, degrees."""


@dataclass(frozen=True, kw_only=True)
class Window(Document):
    """The scanned window."""

    centre_nm: tuple[float | None, float | None]
    """Its centre (x, y), sensor coordinates, nm."""
    extent_nm: tuple[float | None, float | None]
    """Lengths of its sides, the one nearer to x first, first to last pixel, nm."""


decoded_by(
    {
        AgreementResult: {
            "chi2_per_dof": float,
            "variance_factor": float,
        },
        AssumedDriftResult: {
            "sigma_nm_per_min": float,
        },
        AtomicImages: {
            "files": several(None),
        },
        AtomicResult: {
            "distortion": float,
            "drift_nm_per_min": several(float, 2),
            "files": several(None),
            "lattice_angle_deg": Estimate.from_dict,
            "size": float,
        },
        BudgetColumn: {
            "calibration_gain": float,
            "calibration_mismatch": float,
            "calibration_orthogonality": float,
            "drift": float,
            "grid_shape": float,
            "image": float,
            "isotropic_strain": float,
            "lattice_constant": float,
            "pitch_convention": float,
            "poisson_ratio": float,
            "ruler_strain": float,
            "sensor": float,
            "strained_layer": float,
            "total": float,
        },
        BudgetResult: {
            "heterostrain_percent": BudgetColumn.from_dict,
            "lattice_angle_deg": BudgetColumn.from_dict,
            "strain_axis_lab_deg": BudgetColumn.from_dict,
            "strain_e1_percent": BudgetColumn.from_dict,
            "strain_e2_percent": BudgetColumn.from_dict,
            "strain_interval_95_percent": several(float, 2),
            "strain_p_value": float,
            "strain_upper_limit_95_percent": float,
            "strain_vector_covariance": several(several(float, 2), 2),
            "twist_deg": BudgetColumn.from_dict,
            "wavelengths_nm": several(BudgetColumn.from_dict, 3),
        },
        ByHand: {
            "lattice_nm": several(several(float, 2), 2),
            "mask": Mask.from_dict,
            "near_nm": float,
            "regions_nm": several(several(several(float, 2))),
        },
        Calibration: {
            "gain_percent": float,
            "mismatch_percent": float,
            "orthogonality_mrad": float,
            "scanner_bend_percent": float,
            "sensor_bend_percent": float,
        },
        CandidateResult: {
            "behind_by": float,
            "predicted_share": float,
            "second_wavelengths_nm": several(float, 3),
            "wavelengths_nm": several(float, 3),
        },
        Caveat: {
            "attempts": several(None),
        },
        ChecksResult: {
            "bootstrap": ScatterResult.from_dict,
            "leave_one_out": ScatterResult.from_dict,
        },
        Choice: {},
        CombinedResult: {
            "budget": BudgetResult.from_dict,
            "checks": ChecksResult.from_dict,
            "consistency": several(ConsistencyResult.from_dict),
            "drift": DriftResult.from_dict,
            "heterostrain_percent": Estimate.from_dict,
            "joint": JointResult.from_dict,
            "lattice_angle_deg": Estimate.from_dict,
            "readings": ReadingsResult.from_dict,
            "strain_axis_lab_deg": Estimate.from_dict,
            "strain_axis_lattice_deg": Estimate.from_dict,
            "strain_interval_95_percent": several(float, 2),
            "strain_p_value": float,
            "strain_upper_limit_95_percent": float,
            "strain_vector_covariance": several(several(float, 2), 2),
            "strain_vector_percent": several(float, 2),
            "strain_vector_sigma_total_percent": several(float, 2),
            "twist_deg": Estimate.from_dict,
            "vectors": several(LatticeVector.from_dict, 3),
        },
        ConsistencyResult: {
            "drift_sigmas": float,
            "sets": several(None, 2),
            "strain_sigmas": float,
            "twist_sigmas": float,
        },
        Conventions: {},
        Crop: {},
        Curvature: {
            "covariance": several(several(float, 6), 6),
            "per_um": several(float, 6),
        },
        DeviceResult: {
            "angle_deg": float,
            "area": RegionResult.from_dict,
            "centre_nm": several(float, 2),
        },
        DislocationResult: {
            "burgers": several(None, 2),
            "place_nm": several(float, 2),
        },
        DomainsResult: {
            "dislocations": several(DislocationResult.from_dict),
            "extra_nm": several(several(float, 2)),
            "median_twist_deg": float,
            "missing_nm": several(several(float, 2)),
            "node_sigma_nm": float,
            "twist_noise_deg": float,
            "twist_spread_deg": float,
        },
        DriftChangeResult: {
            "chi2": float,
            "x": float,
            "x_sigma": float,
            "y": float,
            "y_sigma": float,
        },
        DriftFitResult: {
            "chi2": float,
            "condition": float,
            "paper_nm_per_min": several(float, 2),
        },
        DriftMonteCarloResult: {
            "correlation": float,
            "residual_nm": Estimate.from_dict,
            "x_nm_per_min": Estimate.from_dict,
            "y_nm_per_min": Estimate.from_dict,
        },
        DriftResult: {
            "correlation": float,
            "fit": DriftFitResult.from_dict,
            "joint": JointResult.from_dict,
            "monte_carlo": DriftMonteCarloResult.from_dict,
            "x_nm_per_min": Estimate.from_dict,
            "y_nm_per_min": Estimate.from_dict,
        },
        Estimate: {
            "sigma": float,
            "sigma_total": float,
            "value": float,
        },
        FailedInput: {},
        GivenDrift: {
            "sigma_nm_per_min": float,
            "x_nm_per_min": float,
            "y_nm_per_min": float,
        },
        HarmonicResult: {
            "amplitude": float,
            "index": several(None, 2),
            "noise": float,
        },
        InputFile: {},
        InputProvenance: {
            "inputs": several(InputFile.from_dict),
            "run": Run.from_dict,
        },
        IsotropicStrainResult: {
            "prior_percent": float,
            "shifts": several(ShiftResult.from_dict),
            "twist_interval_deg": several(float, 2),
        },
        JointResult: {
            "acceleration_nm_per_min2": several(float, 2),
            "fast_gain_percent": Estimate.from_dict,
            "position_instability_pm": float,
            "settling_min": float,
            "tested": several(TestedResult.from_dict),
        },
        KnownOrientation: {
            "angle_deg": float,
            "sigma_deg": float,
        },
        LatticeVector: {
            "covariance_nm2": several(several(float, 2), 2),
            "naive_twist_deg": Estimate.from_dict,
            "polar_angle_deg": float,
            "polar_angle_sigma_deg": float,
            "wavelength_nm": Estimate.from_dict,
            "x_nm": float,
            "y_nm": float,
        },
        LineResult: {
            "candidates": several(CandidateResult.from_dict),
            "comparison": several(LatticeVector.from_dict, 3),
            "origin_nm": several(float, 2),
            "periods": float,
            "pixel_to_nm": several(several(float, 2), 2),
            "predicted_by": float,
            "second_wavelengths_nm": several(float, 3),
            "share_covered": float,
            "shortcut_wavelengths_nm": several(float, 3),
            "signal_to_noise": float,
            "vectors": several(LatticeVector.from_dict, 3),
        },
        MapDetailsResult: {
            "devices": several(DeviceResult.from_dict),
            "domains": DomainsResult.from_dict,
            "grains": several(RegionResult.from_dict),
            "pattern": PatternResult.from_dict,
            "regime": RegimeResult.from_dict,
            "regions": several(RegionResult.from_dict),
            "registry": RegistryResult.from_dict,
            "wanted": WantedResult.from_dict,
        },
        MapResults: {
            "agreement": AgreementResult.from_dict,
            "caveats": several(Caveat.from_dict),
            "conventions": Conventions.from_dict,
            "details": MapDetailsResult.from_dict,
            "drift_change": DriftChangeResult.from_dict,
            "extent_nm": several(several(float, 2), 2),
            "images": several(MappedImage.from_dict),
            "masks": several(MaskCount.from_dict),
            "nodes": several(None, 2),
            "origin_nm": several(float, 2),
            "provenance": Provenance.from_dict,
            "quantities": several(QuantityResult.from_dict),
            "resolution_nm": float,
            "settings": Settings.from_dict,
            "step_nm": several(several(float, 2), 2),
            "stripes": StripesResult.from_dict,
            "whole_image": TwistStrainResult.from_dict,
            "window_nm": float,
        },
        MappedImage: {
            "harmonics": several(HarmonicResult.from_dict),
        },
        Mask: {
            "runs": several(None),
        },
        MaskCount: {},
        MaskShare: {
            "percent": float,
        },
        Material: {
            "cell_angle_deg": float,
            "lattice_constant_b_nm": float,
            "lattice_constant_nm": float,
            "lattice_constant_sigma_nm": float,
            "poisson_ratio": float,
            "poisson_ratio_sigma": float,
        },
        MeanCellResult: {
            "sigma": float,
        },
        MeanResult: {
            "budget": BudgetResult.from_dict,
            "chi2_per_dof": float,
            "drift_assumed": AssumedDriftResult.from_dict,
            "heterostrain_percent": Estimate.from_dict,
            "heterostrain_sigma_unscaled_percent": float,
            "lattice_angle_deg": Estimate.from_dict,
            "readings": ReadingsResult.from_dict,
            "strain_axis_lab_deg": Estimate.from_dict,
            "strain_axis_lattice_deg": Estimate.from_dict,
            "strain_interval_95_percent": several(float, 2),
            "strain_p_value": float,
            "strain_scatter_percent": float,
            "strain_upper_limit_95_percent": float,
            "strain_vector_covariance": several(several(float, 2), 2),
            "strain_vector_percent": several(float, 2),
            "strain_vector_sigma_total_percent": several(float, 2),
            "twist_deg": Estimate.from_dict,
            "twist_scatter_deg": float,
            "twist_sigma_unscaled_deg": float,
            "vectors": several(LatticeVector.from_dict, 3),
        },
        MoireLayers: {
            "material": Material.from_dict,
            "substrate": Material.from_dict,
        },
        NameResult: {
            "strain_percent": float,
            "twist_deg": float,
            "waves": several(several(None, 2), 2),
        },
        NamedSet: {},
        NamesResult: {
            "names": several(NameResult.from_dict),
        },
        OtherSenseResult: {
            "axis_lab_deg": Estimate.from_dict,
            "covariance": several(several(float, 5), 5),
            "lattice_angle_deg": Estimate.from_dict,
            "mean_strain_percent": Estimate.from_dict,
            "shear_percent": Estimate.from_dict,
            "shear_vector_percent": several(float, 2),
            "splits": several(SplitResult.from_dict, 2),
            "total": TensorSigmas.from_dict,
            "twist_deg": Estimate.from_dict,
            "twist_interval_deg": several(float, 2),
        },
        PatternResult: {
            "cell": MeanCellResult.from_dict,
            "lattice_vectors_nm": several(several(float, 2), 2),
            "node_nm": several(float, 2),
            "undistorted": UndistortedResult.from_dict,
        },
        Provenance: {
            "failed": several(FailedInput.from_dict),
            "inputs": several(InputFile.from_dict),
            "run": Run.from_dict,
        },
        QuantityResult: {
            "bends": float,
            "mean": float,
            "mean_sigma": float,
            "noise": float,
            "spread": float,
            "spread_corrected": float,
            "trend": TrendResult.from_dict,
        },
        ReadingsResult: {
            "isotropic_strain": IsotropicStrainResult.from_dict,
            "names": NamesResult.from_dict,
            "solutions": several(SolutionResult.from_dict),
            "solutions_complete_to_percent": float,
            "strain_tensor": StrainTensorResult.from_dict,
        },
        RegimeResult: {
            "blurred_percent": float,
            "reasons": several(None),
            "variation_percent": float,
        },
        RegionMeanResult: {
            "blur": float,
            "mean": float,
            "noise": float,
            "sigma": float,
            "spread": float,
            "spread_below_95": float,
            "spread_corrected": float,
            "spread_widening": float,
        },
        RegionResult: {
            "area_nm2": float,
            "corners_nm": several(several(float, 2)),
            "covered_percent": float,
            "masked_by_percent": several(MaskShare.from_dict),
            "masked_percent": float,
            "mean": TwistStrainResult.from_dict,
            "strain_rms_percent": float,
            "strain_vector_percent": several(RegionMeanResult.from_dict, 2),
            "twist_deg": RegionMeanResult.from_dict,
            "wavelength_nm": RegionMeanResult.from_dict,
        },
        RegistryResult: {
            "layer_1_vectors_nm": several(several(float, 2), 2),
            "moire_vectors_nm": several(several(float, 2), 2),
            "sigma_nm": float,
            "zero_nm": several(float, 2),
        },
        ResidualResult: {
            "chi2": float,
            "displacement_nm": several(float, 2),
            "p_value": float,
        },
        Results: {
            "atomic": AtomicResult.from_dict,
            "caveats": several(Caveat.from_dict),
            "combined": CombinedResult.from_dict,
            "conventions": Conventions.from_dict,
            "failed": several(FailedInput.from_dict),
            "provenance": InputProvenance.from_dict,
            "sets": several(SetResult.from_dict),
            "settings": Settings.from_dict,
        },
        RulerCalibration: {
            "gain_percent": Estimate.from_dict,
            "mismatch_percent": Estimate.from_dict,
            "orthogonality_mrad": Estimate.from_dict,
        },
        RulerResult: {
            "calibration": RulerCalibration.from_dict,
            "drift_nm_per_min": several(Estimate.from_dict, 2),
            "fast_gain": Estimate.from_dict,
            "mean": MeanResult.from_dict,
        },
        Run: {
            "arguments": several(None),
            "atomic": AtomicImages.from_dict,
            "export": several(None),
            "inputs": several(None),
            "known": UserSpecified.from_dict,
            "left_out": several(FailedInput.from_dict),
            "other_files": several(InputFile.from_dict),
            "report": Choice.from_dict,
            "sets": several(NamedSet.from_dict),
            "settings": Settings.from_dict,
        },
        ScanResult: {
            "lines": several(LineResult.from_dict),
            "monte_carlo": StrainMonteCarlo.from_dict,
            "residual": ResidualResult.from_dict,
            "tip_velocity_nm_per_s": TipVelocity.from_dict,
            "twist_strain": ScanTwistStrain.from_dict,
            "vectors": several(ScanVector.from_dict, 3),
            "window": Window.from_dict,
        },
        ScanTwistStrain: {
            "drift_corrected": TwistStrainResult.from_dict,
            "sensor": TwistStrainResult.from_dict,
        },
        ScanVector: {
            "drift_corrected": LatticeVector.from_dict,
            "nominal": LatticeVector.from_dict,
            "polar_angle_deg": float,
            "sensor": LatticeVector.from_dict,
        },
        ScannerCalibration: {
            "covariance": several(several(float, 3), 3),
            "curvature": Curvature.from_dict,
            "gain_percent": float,
            "line_rates_hz": several(float),
            "mismatch_percent": float,
            "orthogonality_mrad": float,
            "sizes_nm": several(several(float, 2)),
        },
        ScatterResult: {
            "drift_nm_per_min": several(float, 2),
            "strain_vector_percent": several(float, 2),
            "twist_deg": float,
        },
        SetLatticeResult: {
            "chi2_per_dof": float,
            "drift_assumed": AssumedDriftResult.from_dict,
            "vectors": several(LatticeVector.from_dict, 3),
            "wavelength_scatter_nm": several(float, 3),
        },
        SetResult: {
            "by_scanner": MeanResult.from_dict,
            "checks": ChecksResult.from_dict,
            "drift": DriftResult.from_dict,
            "forward_backward": TwistStrainResult.from_dict,
            "lattice": SetLatticeResult.from_dict,
            "line_rate_hz": float,
            "mean": MeanResult.from_dict,
            "ruler": RulerResult.from_dict,
            "scans": several(ScanResult.from_dict),
            "uncorrected": MeanResult.from_dict,
        },
        Settings: {
            "by_hand": ByHand.from_dict,
            "calibration": Calibration.from_dict,
            "drift": GivenDrift.from_dict,
            "drift_prior_nm_per_min": float,
            "exclude": several(None),
            "frame_time_sigma_s": float,
            "isotropic_strain_percent": float,
            "lattice_angle": KnownOrientation.from_dict,
            "lattice_angle_2": KnownOrientation.from_dict,
            "material": Material.from_dict,
            "moire_layers": several(MoireLayers.from_dict),
            "moire_waves": several(several(float, 2), 2),
            "ruler_magnification_percent": float,
            "ruler_strain_percent": float,
            "scanner": ScannerCalibration.from_dict,
            "substrate": Material.from_dict,
        },
        ShiftResult: {
            "isotropic_strain_percent": float,
            "twist_change_deg": float,
        },
        SolutionResult: {
            "lattice_angle_deg": float,
            "strain_axis_lab_deg": float,
            "strain_percent": Estimate.from_dict,
            "twist_deg": Estimate.from_dict,
            "waves": several(several(None, 2), 2),
        },
        SplitResult: {
            "axis_lab_deg": Estimate.from_dict,
            "biaxial_percent": Estimate.from_dict,
            "uniaxial_percent": Estimate.from_dict,
        },
        StrainMonteCarlo: {
            "lattice_angle_deg": Estimate.from_dict,
            "strain_vector_covariance": several(several(float, 2), 2),
            "strain_vector_percent": several(float, 2),
            "twist_deg": Estimate.from_dict,
        },
        StrainTensorResult: {
            "alternatives": several(TensorNumbers.from_dict),
            "axis_lab_deg": Estimate.from_dict,
            "covariance": several(several(float, 5), 5),
            "lattice_angle_deg": Estimate.from_dict,
            "mean_strain_percent": Estimate.from_dict,
            "other_sense": OtherSenseResult.from_dict,
            "shear_percent": Estimate.from_dict,
            "shear_vector_percent": several(float, 2),
            "splits": several(SplitResult.from_dict, 2),
            "total": TensorSigmas.from_dict,
            "twist_deg": Estimate.from_dict,
        },
        StripeHarmonicResult: {
            "amplitude": float,
            "local_amplitude": float,
        },
        StripePatternResult: {
            "coherence_percent": float,
            "direction_deg": Estimate.from_dict,
            "harmonics": several(StripeHarmonicResult.from_dict),
            "log10_chance": float,
            "map": several(QuantityResult.from_dict),
            "share_percent": float,
            "wavelength_nm": Estimate.from_dict,
        },
        StripesResult: {
            "patterns": several(StripePatternResult.from_dict),
        },
        TensorNumbers: {
            "axis_lab_deg": Estimate.from_dict,
            "lattice_angle_deg": Estimate.from_dict,
            "mean_strain_percent": Estimate.from_dict,
            "shear_percent": Estimate.from_dict,
            "shear_vector_percent": several(float, 2),
            "twist_deg": Estimate.from_dict,
        },
        TensorSigmas: {
            "axis_lab_deg": float,
            "mean_strain_percent": float,
            "shear_percent": float,
            "twist_deg": float,
        },
        TestedResult: {
            "criterion_gain": float,
        },
        TipVelocity: {
            "fast": Estimate.from_dict,
            "slow": Estimate.from_dict,
        },
        TrendResult: {
            "middle": float,
            "middle_sigma": float,
            "noise": float,
            "of_trend": float,
            "per_100nm": several(float, 2),
            "per_100nm_sigma": several(float, 2),
            "rest": float,
        },
        TwistStrainResult: {
            "heterostrain_percent": Estimate.from_dict,
            "lattice_angle_deg": Estimate.from_dict,
            "strain_axis_lab_deg": Estimate.from_dict,
            "strain_axis_lattice_deg": Estimate.from_dict,
            "strain_interval_95_percent": several(float, 2),
            "strain_p_value": float,
            "strain_upper_limit_95_percent": float,
            "strain_vector_covariance": several(several(float, 2), 2),
            "strain_vector_percent": several(float, 2),
            "strain_vector_sigma_total_percent": several(float, 2),
            "twist_deg": Estimate.from_dict,
        },
        UndistortedResult: {
            "known_percent": float,
            "origin_nm": several(float, 2),
            "pitch_nm": float,
            "pixels": several(None, 2),
        },
        UserSpecified: {
            "crop": Crop.from_dict,
            "line_rate_hz": float,
            "rotation_deg": float,
            "size_nm": several(float, 2),
        },
        WantedResult: {
            "blur_percent": float,
            "certain_percent": float,
            "corrected_percent": float,
            "measured_percent": float,
            "possible_percent": float,
            "twist_deg": float,
            "within_deg": float,
        },
        Window: {
            "centre_nm": several(float, 2),
            "extent_nm": several(float, 2),
        },
    }
)
