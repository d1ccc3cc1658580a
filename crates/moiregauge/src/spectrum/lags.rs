//! An autocorrelation, lag by lag.

/// Autocorrelation: rows of lags 0 … `max_lag[1]`, columns −`max_lag[0]` … `max_lag[0]`.
pub(crate) struct Autocorrelation {
    /// Largest lag along columns and rows.
    pub(crate) max_lag: [usize; 2],
    pub(super) values: Vec<f64>,
}

impl Autocorrelation {
    /// Value at the lag (dx, dy); the function is even. `None` outside or where nothing overlaps.
    pub(crate) fn at(&self, dx: i64, dy: i64) -> Option<f64> {
        let (dx, dy) = if dy < 0 { (-dx, -dy) } else { (dx, dy) };
        let mx = self.max_lag[0] as i64;
        if dx.abs() > mx || dy > self.max_lag[1] as i64 {
            return None;
        }
        let v = self.values[dy as usize * (2 * self.max_lag[0] + 1) + (dx + mx) as usize];
        v.is_finite().then_some(v)
    }
}

pub(crate) enum Overlap {
    Separable(Vec<f64>, Vec<f64>),
    Full(Vec<f64>),
}

impl Overlap {
    pub(super) fn at(&self, ix: usize, iy: usize, width: usize, centre: usize) -> f64 {
        match self {
            Self::Separable(x, y) => x[ix.abs_diff(centre)] * y[iy],
            Self::Full(values) => values[iy * width + ix],
        }
    }
}

/// `Σ_x w(x) w(x + lag)` for lags 0 … `max_lag`.
pub(crate) fn lag_sums(w: &[f64], max_lag: usize) -> Vec<f64> {
    (0..=max_lag)
        .map(|lag| w.iter().zip(&w[lag..]).map(|(a, b)| a * b).sum())
        .collect()
}
