//! The arguments of a command line that its results record.

use std::ffi::OsString;

/// The arguments that can change results, the command first: without the program, where results go, the number of threads
/// and what is printed; without the options `left_out`, too, each of which has one value.
pub(super) fn arguments(all: impl IntoIterator<Item = OsString>, left_out: &[&str]) -> Vec<String> {
    let valued = |text: &str| ["--out", "--threads"].contains(&text) || left_out.contains(&text);
    let mut all = all
        .into_iter()
        .skip(1)
        .map(|a| a.to_string_lossy().into_owned())
        .peekable();
    let mut kept: Vec<String> = all.next().into_iter().collect();
    // Names of files after what is left out move here, lest they follow an option of many values instead.
    let mut place = kept.len();
    while let Some(text) = all.next() {
        if text == "--" {
            kept.push(text);
            kept.extend(all);
            break;
        }
        let flag = ["--force", "--quiet", "-q", "--json", "--open"].contains(&text.as_str());
        let joined = text.split_once('=').is_some_and(|(name, _)| valued(name));
        let apart = valued(&text);
        if !(flag || joined || apart) {
            kept.push(text);
            continue;
        }
        if apart {
            all.next();
        }
        while let Some(file) = all.next_if(|next| !next.starts_with('-')) {
            kept.insert(place, file);
            place += 1;
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kept(all: &str) -> String {
        let all = all.split(' ').map(OsString::from);
        arguments(all, &["--replay"]).join(" ")
    }

    #[test]
    fn what_cannot_change_results_is_left_out() {
        assert_eq!(
            kept("moiregauge analyze s --out r --seed 2 --force -q"),
            "analyze s --seed 2"
        );
        assert_eq!(
            kept("x map --out=r --threads 7 --json a b --set n=p"),
            "map a b --set n=p"
        );
        // The scans are no atomic images.
        assert_eq!(
            kept("x analyze --atomic a b --out r s t --drift -1 2"),
            "analyze s t --atomic a b --drift -1 2"
        );
        assert_eq!(kept("x analyze --replay r.json --out r"), "analyze");
        assert_eq!(kept("x analyze -- --out s"), "analyze -- --out s");
    }
}
