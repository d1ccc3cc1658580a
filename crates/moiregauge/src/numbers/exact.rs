//! Numbers as JSON that reads back to the last bit: what is not finite is text, which JSON has no number for.
//!
//! A composite (vector, matrix, lattice) is the flat list of its numbers, matrices column by column; an option that is
//! empty is an empty list.

use heterostrain::Estimate;
use heterostrain::lattice::Pair;
use nalgebra::SMatrix;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Something that is nothing but numbers.
pub(crate) trait Numbers: Sized {
    /// All of them.
    fn parts(&self) -> Vec<f64>;
    /// The value of these; `None` where they are not as many as it has.
    fn of(parts: &[f64]) -> Option<Self>;
}

/// One number, as it stands in JSON.
#[derive(Serialize, Deserialize)]
#[serde(untagged)]
enum Number {
    Finite(f64),
    Other(NotFinite),
}

#[derive(Serialize, Deserialize)]
enum NotFinite {
    #[serde(rename = "NaN")]
    Nan,
    #[serde(rename = "inf")]
    Infinity,
    #[serde(rename = "-inf")]
    MinusInfinity,
}

impl From<f64> for Number {
    fn from(value: f64) -> Self {
        if value.is_nan() {
            Self::Other(NotFinite::Nan)
        } else if value == f64::INFINITY {
            Self::Other(NotFinite::Infinity)
        } else if value == f64::NEG_INFINITY {
            Self::Other(NotFinite::MinusInfinity)
        } else {
            Self::Finite(value)
        }
    }
}

impl From<Number> for f64 {
    fn from(number: Number) -> Self {
        match number {
            Number::Finite(value) => value,
            Number::Other(NotFinite::Nan) => f64::NAN,
            Number::Other(NotFinite::Infinity) => f64::INFINITY,
            Number::Other(NotFinite::MinusInfinity) => f64::NEG_INFINITY,
        }
    }
}

/// For `#[serde(with = …)]`.
pub(crate) fn serialize<T: Numbers, S: Serializer>(value: &T, to: S) -> Result<S::Ok, S::Error> {
    to.collect_seq(value.parts().into_iter().map(Number::from))
}

/// For `#[serde(with = …)]`.
pub(crate) fn deserialize<'a, T: Numbers, D: Deserializer<'a>>(from: D) -> Result<T, D::Error> {
    let parts: Vec<Number> = Vec::deserialize(from)?;
    let parts: Vec<f64> = parts.into_iter().map(f64::from).collect();
    T::of(&parts).ok_or_else(|| D::Error::custom(format!("{} numbers do not fit", parts.len())))
}

impl Numbers for f64 {
    fn parts(&self) -> Vec<f64> {
        vec![*self]
    }

    fn of(parts: &[f64]) -> Option<Self> {
        match parts {
            [one] => Some(*one),
            _ => None,
        }
    }
}

impl<T: Numbers, const N: usize> Numbers for [T; N] {
    fn parts(&self) -> Vec<f64> {
        self.iter().flat_map(T::parts).collect()
    }

    fn of(parts: &[f64]) -> Option<Self> {
        if parts.is_empty() || N == 0 || !parts.len().is_multiple_of(N) {
            return None;
        }
        let all: Option<Vec<T>> = parts.chunks(parts.len() / N).map(T::of).collect();
        all?.try_into().ok()
    }
}

impl<T: Numbers> Numbers for Option<T> {
    fn parts(&self) -> Vec<f64> {
        self.as_ref().map_or_else(Vec::new, T::parts)
    }

    fn of(parts: &[f64]) -> Option<Self> {
        if parts.is_empty() {
            return Some(None);
        }
        T::of(parts).map(Some)
    }
}

impl<const R: usize, const C: usize> Numbers for SMatrix<f64, R, C> {
    fn parts(&self) -> Vec<f64> {
        self.as_slice().to_vec()
    }

    fn of(parts: &[f64]) -> Option<Self> {
        (parts.len() == R * C).then(|| Self::from_column_slice(parts))
    }
}

impl<Kind, Unit> Numbers for Pair<Kind, Unit> {
    fn parts(&self) -> Vec<f64> {
        [self.basis.parts(), self.covariance.parts()].concat()
    }

    fn of(parts: &[f64]) -> Option<Self> {
        let (basis, covariance) = parts.split_at_checked(4)?;
        Some(Self::new(Numbers::of(basis)?, Numbers::of(covariance)?))
    }
}

impl Numbers for Estimate {
    fn parts(&self) -> Vec<f64> {
        vec![self.value, self.sigma]
    }

    fn of(parts: &[f64]) -> Option<Self> {
        match parts {
            [value, sigma] => Some(Self::new(*value, *sigma)),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix2;

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    struct All {
        #[serde(with = "super")]
        number: f64,
        #[serde(with = "super")]
        none: Option<f64>,
        #[serde(with = "super")]
        matrix: Matrix2<f64>,
    }

    #[test]
    fn numbers_read_back_to_the_last_bit() {
        let all = All {
            number: f64::INFINITY,
            none: None,
            matrix: Matrix2::new(0.1 + 0.2, -0.0, f64::NEG_INFINITY, 5e-324),
        };
        let text = serde_json::to_string(&all).unwrap();
        let back: All = serde_json::from_str(&text).unwrap();
        assert_eq!(back, all);
        assert!(text.starts_with(
            r#"{"number":["inf"],"none":[],"matrix":[0.30000000000000004,"-inf",-0.0,"#
        ));
        let nan: f64 = deserialize(&mut serde_json::Deserializer::from_str(r#"["NaN"]"#)).unwrap();
        assert!(nan.is_nan());
        let short = text.replace(r#""matrix":[0.30000000000000004,"#, r#""matrix":["#);
        assert!(serde_json::from_str::<All>(&short).is_err());
    }
}
