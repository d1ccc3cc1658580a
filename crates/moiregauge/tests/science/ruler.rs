//! Frames that show the atoms of a layer beside the moiré: twist and strain free of drift and calibration.

use std::f64::consts::{FRAC_PI_3, TAU};

use heterostrain::material::Material;
use heterostrain::strain::{StrainTensor, TwistSense};
use moiregauge::campaign::{Analysis, analyse};
use moiregauge::map::TwistStrainMap;
use moiregauge::meaning::Source;
use moiregauge::scan::{measure_moires, measure_scan, sorted_moires};
use moiregauge::settings::{GivenDrift, MoireLayers, RulerLayer, Settings};
use moiregauge::survey::{MapMethod, corrected_images, map_scan};
use moiregauge::window::Resolution;
use nalgebra::{Matrix2, Rotation2, Vector2};
use spmfile::{FrameDirection, Scan, Span};

/// Graphene, nm.
const CONSTANT: f64 = 0.246;
const TWIST: f64 = 0.055;
/// Of layer 2 against layer 1: a mean of 0.15 % and a shear part of 0.11 %.
const STRAIN: Matrix2<f64> = Matrix2::new(1.002, 0.0005, 0.0005, 1.001);

/// Three waves, rad/nm.
type Waves = [Vector2<f64>; 3];

/// Of a layer that was deformed: they meet, the third is the second less the first.
fn waves(constant: f64, deformation: &Matrix2<f64>) -> Waves {
    let length = 2.0 * TAU / (3f64.sqrt() * constant);
    let back = deformation.try_inverse().unwrap().transpose();
    let of = |angle: f64| back * Vector2::new(angle.cos(), angle.sin()) * length;
    let [a, b] = [of(0.0), of(FRAC_PI_3)];
    [a, b, b - a]
}

/// A frame of a scanner that shows `frame` times what is there: moirés of amplitude 1, atoms of amplitude `atoms`, changed by the first
/// moiré, and some noise.
struct Shown<'a> {
    frame: &'a Matrix2<f64>,
    /// By how much of the size of the frame the scanner bends along both axes.
    bow: f64,
    atoms: f64,
    seed: u64,
    pixels: usize,
    /// nm.
    size: f64,
}

/// Atoms of layer 2, which is turned by `TWIST` and strained against layer 1.
fn frame(frame: &Matrix2<f64>, atoms: f64, seed: u64) -> Scan {
    bent_frame(frame, 0.0, atoms, seed)
}

/// The same of a scanner that bends.
fn bent_frame(frame: &Matrix2<f64>, bow: f64, atoms: f64, seed: u64) -> Scan {
    let first = Rotation2::new(0.4).into_inner();
    let second = Rotation2::new(TWIST).into_inner() * STRAIN * first;
    let layers = [first, second].map(|layer| waves(CONSTANT, &layer));
    let shown = Shown {
        frame,
        bow,
        atoms,
        seed,
        pixels: 256,
        size: 18.0,
    };
    shown.scan(&layers[1], &layers[..1])
}

impl Shown<'_> {
    /// The atoms of a layer and its moirés with others.
    fn scan(&self, seen: &Waves, others: &[Waves]) -> Scan {
        let (pixels, size) = (self.pixels, self.size);
        let inverse = self.frame.try_inverse().unwrap();
        let pitch = size / pixels as f64;
        let mut state = self.seed;
        let mut values = Vec::new();
        // The top row comes first.
        for row in (0..pixels).rev() {
            for column in 0..pixels {
                let at = Vector2::new(column as f64, row as f64) * pitch;
                let share = at / size;
                let bent = Vector2::new(share.y.powi(2), share.x * share.y) * self.bow * size;
                let at = inverse * (at + bent);
                let sum = |of: &dyn Fn(usize) -> Vector2<f64>| {
                    (0..3).map(|i| of(i).dot(&at).cos()).sum::<f64>()
                };
                let moires = others
                    .iter()
                    .map(|other| sum(&|i| seen[i] - other[i]))
                    .collect::<Vec<_>>();
                state = state
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1_442_695_040_888_963_407);
                let noise = (state >> 40) as f64 / (1u64 << 24) as f64 - 0.5;
                let atoms = self.atoms * (1.0 + 0.2 * moires[0]) * sum(&|i| seen[i]);
                values.push(moires.iter().sum::<f64>() + atoms + noise);
            }
        }
        let mut bytes = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
        let head =
            format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({pixels}, {pixels}), }}");
        bytes.extend(format!("{head:<117}\n").bytes());
        bytes.extend(values.iter().flat_map(|v| v.to_le_bytes()));
        let mut scan = spmfile::read(&bytes).unwrap();
        scan.size_nm = Some([size; 2]);
        scan.line_rate_hz = Some(10.0);
        scan.frame_direction = Some(FrameDirection::Up);
        for channel in &mut scan.channels {
            (channel.width_nm, channel.height_nm) = (Some(size), Some(size));
            channel.span = Span::PixelEdges;
        }
        scan
    }
}

fn analysed(scans: &[Scan], ruler: RulerLayer) -> Analysis {
    let settings = Settings {
        drift_draws: 0,
        strain_draws: 0,
        ruler,
        ..Settings::default()
    };
    let named = scans.iter().enumerate();
    let measured =
        named.map(|(i, scan)| measure_scan(&format!("scan.{i}"), scan, &settings, None).unwrap());
    analyse(measured.collect(), &settings)
}

/// Gain, skew and drift of a scanner that is off by per cents.
fn scanner(gain: f64) -> Matrix2<f64> {
    Matrix2::new(gain, 0.012, 0.004, 0.985 * gain)
}

/// Whatever the scanner does, twist and mean strain are those of the layers within their errors, which are some ten thousandths.
#[test]
fn one_frame_gives_twist_and_mean_strain() {
    let mean_strain = 0.0015;
    for (seed, gain) in [(1, 1.0), (2, 1.03), (3, 0.97)] {
        let found = analysed(&[frame(&scanner(gain), 0.5, seed)], RulerLayer::Auto);
        let set = &found.sets[0];
        let ruler = set.ruler.as_ref().unwrap();
        assert!(ruler.used && ruler.layer == 2);
        let mean = set.mean.as_ref().unwrap();
        let twist = mean.twist();
        let pull = (twist.value - TWIST) / twist.total;
        assert!(pull.abs() < 4.0 && twist.total < 1e-3 * TWIST, "{twist:?}");
        let tensor = mean.readings.tensor.as_ref().unwrap().in_all();
        let strain = tensor.mean();
        assert!(
            (strain.value - mean_strain).abs() < 4.0 * strain.sigma && strain.sigma < 1e-4,
            "{strain:?}"
        );
        assert!(
            (ruler.fast_gain.value / (gain * 1.0015) - 1.0).abs() < 2e-3 + 0.0012,
            "{:?}",
            ruler.fast_gain
        );
        // The other row is of the ruler; those of the scanner are zero.
        assert!(mean.budget.of(Source::RulerStrain).wavelengths[0] > 0.0);
        assert_eq!(mean.budget.of(Source::Gain).covariance[(0, 0)], 0.0);
        // The scanner alone is there, and knows far less.
        let alone = set.by_scanner.as_ref().unwrap();
        assert!(alone.twist().total > 10.0 * twist.total);
    }
}

/// Frames through scanners that differ are of one lattice in the ruler.
#[test]
fn frames_agree_in_the_ruler() {
    let scans = [1.0, 1.004].map(|gain| frame(&scanner(gain), 0.5, (1000.0 * gain) as u64));
    let found = analysed(&scans, RulerLayer::Auto);
    let mean = found.sets[0].mean.as_ref().unwrap();
    assert_eq!(mean.budget.ruler, Some(2));
    assert!(mean.chi2_per_dof.unwrap() < 4.0, "{:?}", mean.chi2_per_dof);
    let all = found.combined.as_ref().unwrap();
    assert_eq!(all.twist_strain.twist, mean.twist_strain.twist);
}

/// No ruler without atoms, and none where it is switched off: the moiré is found all the same, and measured by the scanner.
#[test]
fn there_is_no_ruler_without_atoms() {
    let scanner = scanner(1.0);
    let without = analysed(&[frame(&scanner, 0.0, 5)], RulerLayer::Auto);
    assert!(without.sets[0].ruler.is_none());
    let off = analysed(&[frame(&scanner, 0.5, 5)], RulerLayer::Off);
    assert!(off.sets[0].ruler.is_none());
    let twist = |found: &Analysis| found.sets[0].mean.as_ref().unwrap().twist();
    let [alone, beside] = [&without, &off].map(twist);
    assert!((alone.value - beside.value).abs() < 1e-4 * TWIST);
    assert!(beside.total > 0.005 * TWIST);
}

/// Maps and exported images are in the coordinates of the atoms; node by node, what bends slowly drops out.
#[test]
fn maps_and_images_are_by_the_atoms() {
    let (shown, settings) = (scanner(1.03), Settings::default());
    for bow in [0.0, 0.003] {
        let scan = bent_frame(&shown, bow, 0.5, 7);
        let found = analysed(std::slice::from_ref(&scan), RulerLayer::Auto);
        let (set, resolution) = (&found.sets[0], Resolution::default());
        let seen = &set.scans[0];
        let maps = map_scan(
            &scan,
            seen,
            None,
            &settings,
            MapMethod::Demodulation,
            &resolution,
        );
        let map = &maps.unwrap()[0];
        let (atoms, by_nodes) = map.ruler.unwrap();
        assert!(by_nodes && map.drift_corrected);
        let nodes =
            map.map
                .twist_strain_by(&atoms.ruler, atoms.layer, atoms.twist, settings.bilayer());
        let twist = TwistStrainMap::new(&map.map, &nodes);
        let twist = twist.spread(&twist.twist).unwrap();
        let pull = (twist.mean - TWIST) / twist.mean_sigma;
        assert!(
            pull.abs() < 4.0 && twist.mean_sigma < 2e-3 * TWIST,
            "{bow}: {twist:?}"
        );
        assert!(twist.spread < 1.5 * twist.noise, "{bow}: {twist:?}");
    }
    let scan = frame(&shown, 0.5, 7);
    let found = analysed(std::slice::from_ref(&scan), RulerLayer::Auto);
    let image = corrected_images(&scan, &found.sets[0].scans[0], &settings);
    assert!(
        image[0]
            .log
            .iter()
            .any(|line| line.contains("atoms of layer 2"))
    );
    let again = analysed(&[image[0].scan.clone()], RulerLayer::Off);
    let lattice = |found: &Analysis| {
        let set = &found.sets[0];
        set.mean
            .as_ref()
            .map_or_else(|| set.scans[0].sensor, |m| m.lattice)
    };
    let [first, second] = [&found, &again].map(lattice);
    for i in 0..3 {
        let [a, b] = [first, second].map(|l| l.wavelength(i).value);
        assert!((a / b - 1.0).abs() < 2e-3, "{a} {b}");
    }
}

/// The drift of one frame is that of the sample in true lengths, whatever the gain; what is left is the strain of the layer that is the ruler.
#[test]
fn the_drift_of_a_frame_has_no_gain() {
    let (gain, drift) = (1.05, Vector2::new(0.035, 0.05));
    // Lines of 0.05 s, ten in a second.
    let pitch = 18.0 / 256.0;
    let times = Vector2::new(0.05 / 255.0, 0.1) / pitch;
    let map = Matrix2::identity() / gain - drift * times.transpose();
    let shown = map.try_inverse().unwrap();
    let found = analysed(&[frame(&shown, 0.5, 21)], RulerLayer::Auto);
    let found = found.sets[0].ruler.as_ref().unwrap().drift.unwrap();
    let slow_speed = pitch / 0.1;
    for (found, drift) in found.iter().zip(&drift) {
        assert!(
            (found.value - drift).abs() < 0.0015 * slow_speed,
            "{found:?} {drift}"
        );
    }
}

/// Gains and skew of the scanner at a drift that is known are those of its map, by the polar decomposition of what the atoms show.
#[test]
fn the_atoms_calibrate_the_scanner() {
    let settings = Settings {
        drift_draws: 0,
        strain_draws: 0,
        drift: Some(GivenDrift {
            x_nm_per_min: 0.0,
            y_nm_per_min: 0.0,
            sigma_nm_per_min: 0.0,
        }),
        ..Settings::default()
    };
    let shown = scanner(1.02);
    let scan = measure_scan("scan", &frame(&shown, 0.5, 11), &settings, None).unwrap();
    let found = analyse(vec![scan], &settings);
    let found = found.sets[0].ruler.as_ref().unwrap().calibration.unwrap();
    // Layer 2 is strained itself.
    let f =
        shown * Rotation2::new(TWIST).into_inner() * STRAIN * Rotation2::new(-TWIST).into_inner();
    let stretch = (f * f.transpose()).symmetric_eigen();
    let root = Matrix2::from_diagonal(&stretch.eigenvalues.map(f64::sqrt));
    let f = stretch.eigenvectors * root * stretch.eigenvectors.transpose();
    let expected = [
        100.0 * (f64::midpoint(f.m11, f.m22) - 1.0),
        100.0 * (f.m11 - f.m22),
        2000.0 * f.m12,
    ];
    for (found, expected) in found.iter().zip(expected) {
        assert!(
            (found.value - expected).abs() < 0.02,
            "{found:?} {expected}"
        );
        assert!(found.sigma > 0.05);
    }
}

/// Graphene on hBN near 1.7°: the symmetry of the seen layer leaves two readings, which differ in more than their sense. Both are told, and one
/// of them is true; the sense of the twist decides.
#[test]
fn different_layers_have_readings_of_which_the_sense_decides() {
    let (twist, strain) = (0.03, Matrix2::new(0.9999, 0.0002, 0.0002, 0.9992));
    let hbn = Material::named("hBN").unwrap();
    let first = Rotation2::new(0.4).into_inner();
    let second = Rotation2::new(twist).into_inner() * strain * first;
    let [lower, upper] = [
        waves(hbn.lattice_constant_nm, &first),
        waves(CONSTANT, &second),
    ];
    let shown = Shown {
        frame: &scanner(1.01),
        bow: 0.0,
        atoms: 0.5,
        seed: 3,
        pixels: 320,
        size: 28.0,
    };
    let scan = shown.scan(&upper, &[lower]);
    let found = |twist_sense: Option<TwistSense>| {
        let settings = Settings {
            drift_draws: 0,
            strain_draws: 0,
            substrate: Some(hbn.clone()),
            ruler: RulerLayer::Second,
            twist_sense,
            ..Settings::default()
        };
        analyse(
            vec![measure_scan("scan", &scan, &settings, None).unwrap()],
            &settings,
        )
    };
    let pulls = |tensor: &StrainTensor| {
        let mean = (tensor.mean - (strain.trace() / 2.0 - 1.0)) / tensor.mean().sigma;
        [(tensor.twist - twist) / tensor.twist().sigma, mean]
    };
    let open = found(None);
    let ruler = open.sets[0].ruler.as_ref().unwrap();
    assert!(!ruler.used);
    let told = |found: &Analysis| {
        let mut codes = found.caveats.iter().map(moiregauge::caveat::Caveat::code);
        codes.any(|code| code == "ruler-readings-open")
    };
    assert!(told(&open));
    let tensor = ruler.mean.readings.tensor.as_ref().unwrap();
    let readings: Vec<StrainTensor> = std::iter::once(tensor.in_all())
        .chain(ruler.others())
        .collect();
    assert!(readings.len() > 1);
    let true_ones = readings
        .iter()
        .filter(|t| pulls(t).iter().all(|pull| pull.abs() < 4.0));
    assert_eq!(true_ones.count(), 1, "{readings:?}");
    let decided = found(Some(TwistSense::Positive));
    let set = &decided.sets[0];
    assert!(set.ruler.as_ref().unwrap().used && !told(&decided));
    let tensor = set.mean.as_ref().unwrap().readings.tensor.as_ref().unwrap();
    assert!(pulls(&tensor.in_all()).iter().all(|pull| pull.abs() < 4.0));
}

/// A layer between or on two others: its atoms measure both of its moirés, once it is told that it is a layer of both. A moiré of
/// other layers stays with the scanner.
#[test]
fn one_ruler_measures_two_moires() {
    let twists = [TWIST, 0.095];
    let first = Rotation2::new(0.4).into_inner();
    let seen = waves(CONSTANT, &first);
    // Layer 2 is the seen one, so that the other is turned back.
    let others = twists.map(|twist| {
        let f = Rotation2::new(twist).into_inner() * STRAIN;
        waves(CONSTANT, &(f.try_inverse().unwrap() * first))
    });
    let shown = Shown {
        frame: &scanner(1.03),
        bow: 0.0,
        atoms: 0.6,
        seed: 4,
        pixels: 256,
        size: 18.0,
    };
    let scan = shown.scan(&seen, &others);
    let found = |rulers: [RulerLayer; 2]| {
        let of = |ruler| MoireLayers {
            ruler: Some(ruler),
            ..MoireLayers::new(Material::graphene(), None)
        };
        let settings = Settings {
            drift_draws: 0,
            strain_draws: 0,
            moires: 2,
            moire_layers: rulers.map(of).to_vec(),
            ..Settings::default()
        };
        let moires = measure_moires("scan", &scan, &settings, None).unwrap();
        let of_moire = |(i, scans)| analyse(scans, &settings.of_moire(i));
        let sorted = sorted_moires(vec![moires]).into_iter().enumerate();
        sorted.map(of_moire).collect::<Vec<Analysis>>()
    };
    let by_atoms = |found: &Analysis, twist: f64| {
        let set = &found.sets[0];
        assert!(set.ruler.as_ref().unwrap().used);
        let mean = set.mean.as_ref().unwrap();
        let own = mean.twist();
        assert!(
            (own.value - twist).abs() < 4.0 * own.total && own.total < 2e-3 * twist,
            "{own:?} {twist}"
        );
        let strain = mean.readings.tensor.as_ref().unwrap().in_all().mean();
        assert!(
            (strain.value - 0.0015).abs() < 4.0 * strain.sigma && strain.sigma < 2e-4,
            "{strain:?}"
        );
    };
    let both = found([RulerLayer::Second; 2]);
    for (found, twist) in both.iter().zip(twists) {
        by_atoms(found, twist);
    }
    let [one, other] = &found([RulerLayer::Second, RulerLayer::Off])[..] else {
        panic!("two moirés");
    };
    by_atoms(one, twists[0]);
    assert!(other.sets[0].ruler.is_none());
    for found in found([RulerLayer::Auto; 2]) {
        assert!(!found.sets[0].ruler.as_ref().unwrap().used);
        let mut codes = found.caveats.iter().map(moiregauge::caveat::Caveat::code);
        assert!(codes.any(|code| code == "ruler-moire-open"));
    }
}

/// What is 8.5 % smaller than the atoms of the layer is no ruler for a scanner that is known to 1 %, unless the user says that it is the layer, or that the
/// scanner may be off by as much.
#[test]
fn the_calibration_excludes_a_ruler() {
    let scan = frame(&scanner(0.915), 0.5, 4);
    let used = |ruler, gain_percent| {
        let mut settings = Settings {
            drift_draws: 0,
            strain_draws: 0,
            ruler,
            ..Settings::default()
        };
        settings.calibration.gain_percent = gain_percent;
        let measured = measure_scan("scan", &scan, &settings, None).unwrap();
        let found = analyse(vec![measured], &settings);
        let doubts = found.caveats.iter();
        let excluded = doubts.filter(|caveat| caveat.code() == "ruler-contradicts");
        (found.sets[0].ruler.as_ref().unwrap().used, excluded.count())
    };
    assert_eq!(used(RulerLayer::Auto, 1.0), (false, 1));
    assert_eq!(used(RulerLayer::Second, 1.0), (true, 1));
    assert_eq!(used(RulerLayer::Auto, 3.0), (true, 0));
}
