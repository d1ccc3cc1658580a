//! Doubts about scans: of each kind the worst one, and how many scans have it.

use std::fmt;

use crate::caveat::lattices::{LatticeDoubt, LineDifference};
use crate::caveat::positions::PositionDoubt;
use crate::caveat::{Caveat, Doubt};

/// How many scans of a set have a doubt.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Having {
    /// Scans that have it.
    pub scans: usize,
    /// Scans of the set.
    pub of: usize,
    /// The file in which it is largest; `None` for a doubt without a size.
    pub worst: Option<String>,
}

impl fmt::Display for Having {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, " ({} of {} scans", self.scans, self.of)?;
        if let Some(file) = &self.worst {
            write!(f, "; worst: {file}")?;
        }
        f.write_str(")")
    }
}

/// The doubts of the scans of a set, each kind once. Where several scans have it, it concerns the set, in the words of the scan in which it
/// is largest.
pub(crate) fn each_kind_once<'a>(
    set: &str,
    scans: impl IntoIterator<Item = &'a Vec<Caveat>>,
) -> Vec<Caveat> {
    let mut kinds: Vec<Kind> = Vec::new();
    let mut of = 0;
    for caveats in scans {
        of += 1;
        for caveat in caveats {
            match kinds.iter_mut().find(|kind| alike(kind.worst, caveat)) {
                Some(kind) => kind.put(caveat, of),
                None => kinds.push(Kind {
                    worst: caveat,
                    scans: 1,
                    last: of,
                }),
            }
        }
    }
    kinds.iter().map(|kind| kind.told(set, of)).collect()
}

/// Caveats of one kind.
struct Kind<'a> {
    worst: &'a Caveat,
    /// How many scans have it.
    scans: usize,
    /// The last of them: trace and retrace are one scan.
    last: usize,
}

impl<'a> Kind<'a> {
    fn put(&mut self, caveat: &'a Caveat, scan: usize) {
        self.scans += usize::from(self.last != scan);
        self.last = scan;
        if size(&caveat.doubt) > size(&self.worst.doubt) {
            self.worst = caveat;
        }
    }

    fn told(&self, set: &str, of: usize) -> Caveat {
        let mut told = self.worst.clone();
        if self.scans > 1 {
            told.having = Some(Having {
                scans: self.scans,
                of,
                worst: size(&told.doubt).map(|_| std::mem::take(&mut told.place)),
            });
            set.clone_into(&mut told.place);
        }
        told
    }
}

/// Whether two doubts are of one kind: those of a code that have a size, else those whose words differ in numbers only, since other words
/// name another reason.
fn alike(a: &Caveat, b: &Caveat) -> bool {
    let words = |caveat: &Caveat| {
        let number = |c: char| c.is_ascii_digit() || c == '.';
        caveat.message().replace(number, "")
    };
    let sized = |caveat: &Caveat| size(&caveat.doubt).is_some();
    a.code() == b.code() && (sized(a) && sized(b) || words(a) == words(b))
}

/// How large a doubt about a scan is, beside others of its code; `None` where no number says it.
pub(super) fn size(doubt: &Doubt) -> Option<f64> {
    match doubt {
        Doubt::Positions(doubt) => of_positions(doubt),
        Doubt::Lattice(doubt) => of_lattice(doubt),
        Doubt::Recorded(doubt) => doubt.size(),
        _ => None,
    }
}

fn of_positions(doubt: &PositionDoubt) -> Option<f64> {
    match doubt {
        PositionDoubt::SensorGlitches {
            dropped, samples, ..
        } => Some(*dropped as f64 / *samples as f64),
        PositionDoubt::SensorLag { share, .. } | PositionDoubt::LinesBent { share, .. } => {
            Some(*share)
        }
        PositionDoubt::SensorSpan { measured, nominal } => {
            let off = |i: usize| (measured[i] / nominal[i]).ln().abs();
            Some(off(0).max(off(1)))
        }
        _ => None,
    }
}

fn of_lattice(doubt: &LatticeDoubt) -> Option<f64> {
    match doubt {
        LatticeDoubt::FewPeriods { periods, .. } => Some(-periods),
        LatticeDoubt::PartlyCovered { share, .. } => Some(-share),
        LatticeDoubt::LinesDisagree(LineDifference::BeyondErrors { share, .. }) => Some(*share),
        LatticeDoubt::Inhomogeneous {
            wavelength, angle, ..
        }
        | LatticeDoubt::Changes {
            wavelength, angle, ..
        } => Some(wavelength.max(*angle)),
        LatticeDoubt::GroundTakenOff { window } => Some(*window),
        LatticeDoubt::SeveralGrains { others } => Some(others.iter().map(|g| g.share).sum()),
        LatticeDoubt::HarmonicsDisagree { times, .. } => Some(*times),
        LatticeDoubt::Rivals { rivals } => Some(*rivals as f64),
        LatticeDoubt::PartOfCell { part: other, .. } | LatticeDoubt::OtherLattice { other, .. } => {
            Some(other.share)
        }
        LatticeDoubt::SecondLattice { strength, .. } => Some(*strength),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::caveat::files::FileDoubt;

    fn few(periods: f64, file: &str) -> Caveat {
        let enough = 5.0;
        Caveat::new(LatticeDoubt::FewPeriods { periods, enough }, file)
    }

    fn left_out(reason: &str, file: &str) -> Caveat {
        let reason = reason.to_owned();
        Caveat::new(FileDoubt::LineLeftOut { reason }, file)
    }

    fn flat(file: &str) -> Caveat {
        Caveat::new(PositionDoubt::SensorsFlat, file)
    }

    /// Four scans: trace and retrace of one are one scan, the worst is neither first nor last, one reason has other numbers, and one
    /// is another reason.
    #[test]
    fn a_set_has_one_caveat_of_each_kind() {
        let scans = [
            vec![few(4.5, "a"), few(4.4, "a"), flat("a")],
            vec![few(3.1, "b"), left_out("ratio 2.5", "b"), flat("b")],
            vec![few(4.0, "c"), left_out("ratio 12", "c")],
            vec![left_out("constant", "d")],
        ];
        let told: Vec<(String, String)> = each_kind_once("set", &scans)
            .into_iter()
            .map(|caveat| (caveat.message(), caveat.place))
            .collect();
        let expected = [
            (few(3.1, "").message() + " (3 of 4 scans; worst: b)", "set"),
            (flat("").message() + " (2 of 4 scans)", "set"),
            (
                left_out("ratio 2.5", "").message() + " (2 of 4 scans)",
                "set",
            ),
            (left_out("constant", "").message(), "d"),
        ];
        assert_eq!(
            told,
            expected.map(|(words, place)| (words, place.to_owned()))
        );
    }
}
