//! The layers known by name.
//!
//! Uncertainties are those between sources; where there is one source, or one whose number was not seen in print, 0.0005 nm
//! and 0.03 or more, and the source says so. Bulk crystals stand for their layers. The Poisson ratio of a layer with the 2D moduli K and G is (K − G)/(K + G).

/// One layer: a (nm); b (nm) and γ (degrees) where it is not hexagonal; ν; uncertainties of a and ν.
pub(crate) struct Row {
    pub(crate) name: &'static str,
    pub(crate) a: f64,
    pub(crate) cell: Option<(f64, f64)>,
    pub(crate) poisson_ratio: f64,
    pub(crate) a_sigma: f64,
    pub(crate) poisson_ratio_sigma: f64,
    pub(crate) source: &'static str,
}

const fn hexagonal(
    name: &'static str,
    [a, a_sigma]: [f64; 2],
    [poisson_ratio, poisson_ratio_sigma]: [f64; 2],
    source: &'static str,
) -> Row {
    Row {
        name,
        a,
        cell: None,
        poisson_ratio,
        a_sigma,
        poisson_ratio_sigma,
        source,
    }
}

pub(crate) const GRAPHENE: Row = hexagonal(
    "graphene",
    [0.246, 0.0001],
    [0.16, 0.03],
    "a: Cao et al. 2018, arXiv 1803.02342; ν: Blakslee et al. 1970; both as used in arXiv 2008.09761 and 2406.08681",
);

pub(crate) const OTHERS: [Row; 8] = [
    hexagonal(
        "hBN",
        [0.2504, 0.0003],
        [0.21, 0.03],
        "a: 0.25039 nm by X-rays, Pease 1952, Acta Cryst. 5, 356 (0.251 nm is also in use); ν: Falin et al. 2017, Nature Communications 8, 15815",
    ),
    hexagonal(
        "MoS2",
        [0.3160, 0.0005],
        [0.25, 0.03],
        "a: bulk molybdenite, 0.316 nm in handbooks and in Wilson and Yoffe 1969; ν: DFT, Çakır et al. 2014, Appl. Phys. Lett. 104, 203110, number not verified",
    ),
    hexagonal(
        "MoSe2",
        [0.3288, 0.0005],
        [0.21, 0.02],
        "a, and ν from the 2D moduli: Shabani et al. 2021, Nature Physics 17, 720; Halbertal et al. 2021, Nature Communications 12, 242",
    ),
    hexagonal(
        "MoTe2",
        [0.352, 0.0005],
        [0.24, 0.03],
        "a: bulk 2H, 0.3519 nm in data collections, primary source not verified; ν: DFT, Çakır et al. 2014, Appl. Phys. Lett. 104, 203110, number not verified",
    ),
    hexagonal(
        "WS2",
        [0.3153, 0.0005],
        [0.22, 0.03],
        "a: bulk 2H, 0.31532 nm, Schutte et al. 1987, J. Solid State Chem. 70, 207; ν: DFT (PBE), C₁₁ = 143.2 and C₁₂ = 31.5 N/m of the layer",
    ),
    hexagonal(
        "WSe2",
        [0.3282, 0.0005],
        [0.17, 0.02],
        "a, and ν from the 2D moduli: Shabani et al. 2021, Nature Physics 17, 720; Halbertal et al. 2021, Nature Communications 12, 242",
    ),
    hexagonal(
        "NbSe2",
        [0.3444, 0.001],
        [0.25, 0.05],
        "a: bulk 2H, as in Wilson and Yoffe 1969, number not verified (0.3458 nm is the mean below the charge-density-wave transition); ν: between 0.2 and 0.3, no source, give your own",
    ),
    Row {
        name: "WTe2 1T′",
        a: 0.348,
        cell: Some((0.625, 90.0)),
        poisson_ratio: 0.2,
        a_sigma: 0.001,
        poisson_ratio_sigma: 0.1,
        source: "a, b: bulk, Brown 1966, Acta Cryst. 20, 268, numbers not verified; ν: a guess, the layer is not isotropic, give your own",
    },
];
