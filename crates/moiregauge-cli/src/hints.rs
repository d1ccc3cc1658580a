//! Options of this program that help against what is doubtful.

/// By the code of a caveat.
const HINTS: [(&str, &str); 47] = [
    ("several-images", "--channel NAME or --image N"),
    ("channel-chosen", "--channel NAME"),
    ("nothing-excluded", "--exclude NAME with the name of a file"),
    (
        "frame-turned",
        "--rotation 0 for angles in the axes of the image",
    ),
    ("sensors-of-other-line", "--line trace or --line retrace"),
    ("no-position-sensors", "--calibration FILE"),
    ("sensor-plane-fitted", "--calibration FILE"),
    ("sensor-shape", "--calibration FILE"),
    ("sensors-flat", "--calibration FILE"),
    ("lines-disagree", "--line trace or --line retrace"),
    ("rival-waves", "--near WAVELENGTH or --moires 2"),
    ("second-lattice", "--moires 2"),
    ("method-paper-bias", "--method lattice"),
    ("line-levelling", "--background plane"),
    (
        "no-timing",
        "--line-rate HZ and --frame-direction up or down",
    ),
    ("drift-undetermined", "--drift X Y"),
    (
        "headers-contradict-images",
        "--line-rate HZ or --frame-direction up or down",
    ),
    ("frames-do-not-link", "--exclude NAME or --line-rate HZ"),
    ("dates-contradict-line-rate", "--line-rate HZ"),
    (
        "drift-not-separated",
        "--drift-sigma NM/MIN or --line-rate HZ",
    ),
    ("shell-for-lattice", "--near WAVELENGTH or --lattice"),
    ("drift-outruns-scan", "--near WAVELENGTH or --exclude"),
    ("grains-contradict", "--region, --mask or --grain"),
    ("outlying-scan", "--exclude NAME or --exclude-outliers"),
    ("samples-mixed", "--set NAME=PATH"),
    ("large-strain", "--layers UPPER/LOWER or --size W×H"),
    ("no-moire", "--layers UPPER/LOWER"),
    ("layers-cannot-make-it", "--layers UPPER/LOWER"),
    ("moire-doubtful", "--layers UPPER/LOWER"),
    ("strain-within-calibration", "--calibration FILE"),
    (
        "twist-trades-with-strain",
        "--lattice-angle DEG±SIGMA or --atomic FILE",
    ),
    (
        "names-compete",
        "--lattice-angle DEG±SIGMA or --atomic FILE",
    ),
    (
        "orientation-contradicts",
        "--lattice-angle-of or --lattice-angle-layer",
    ),
    (
        "twist-sense-unused",
        "--lattice-angle DEG±SIGMA or --atomic FILE",
    ),
    (
        "twist-sense-open",
        "--twist-sense or --lattice-angle-2 DEG±SIGMA",
    ),
    ("ruler-readings-open", "--twist-sense"),
    (
        "ruler-moire-open",
        "--ruler 2,off with one entry for each moiré",
    ),
    ("ruler-layer-open", "--ruler 1 or --ruler 2"),
    ("no-twist-strain", "--layers UPPER/LOWER"),
    ("map-not-drift-corrected", "--drift X Y"),
    ("map-of-grains", "--grain N"),
    (
        "map-narrow-margin",
        "--margin 2, which leaves the outer nodes out",
    ),
    ("map-registration", "--exclude NAME"),
    ("device-below-resolution", "--window NM"),
    ("phases-in-doubt", "--domains on or --window NM"),
    ("no-domains", "--nodes bright or --nodes dark"),
    ("nodes-bright-or-dark", "--nodes bright or --nodes dark"),
];

/// The options that help against a doubt, if there are any.
pub(crate) fn of(code: &str) -> Option<&'static str> {
    let found = HINTS.iter().find(|(of, _)| *of == code);
    found.map(|(_, option)| *option)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arguments;

    #[test]
    fn hints_are_for_doubts_that_there_are() {
        for (code, _) in HINTS {
            let known = moiregauge::caveat::explained().any(|e| e.code == code);
            assert!(known, "{code}");
        }
    }

    #[test]
    fn hints_name_options_that_there_are() {
        let commands = arguments();
        let mut options: Vec<String> = Vec::new();
        for command in ["analyze", "map", "calibrate"] {
            let command = commands.find_subcommand(command).expect("a command");
            options.extend(
                command
                    .get_arguments()
                    .filter_map(|a| Some(format!("--{}", a.get_long()?))),
            );
        }
        for (code, hint) in HINTS {
            let words = hint.split([' ', ',']);
            let named: Vec<&str> = words.filter(|word| word.starts_with("--")).collect();
            assert!(!named.is_empty(), "{code}");
            for option in named {
                assert!(options.iter().any(|o| o == option), "{code}: {option}");
            }
        }
    }
}
