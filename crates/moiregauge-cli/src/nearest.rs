//! What somebody may have meant.

/// So alike are a name and its misspelling, by Jaro and Winkler: one sign in six may be wrong, or two change places.
const ALIKE: f64 = 0.8;

/// `; did you mean "graphene"?`, where one of the names is like what was typed; nothing otherwise.
pub(crate) fn nearest<'a>(typed: &str, names: impl Iterator<Item = &'a str>) -> String {
    let plain = |text: &str| text.trim().to_lowercase();
    let typed = plain(typed);
    let likeness = |name: &str| strsim::jaro_winkler(&typed, &plain(name));
    let best = names
        .map(|name| (likeness(name), name))
        .max_by(|a, b| a.0.total_cmp(&b.0));
    match best {
        Some((likeness, name)) if likeness > ALIKE => format!("; did you mean {name:?}?"),
        _ => String::new(),
    }
}

/// The same for a key of a settings file that is not known, from the words of the error that lists the known ones.
pub(crate) fn nearest_key(error: &str) -> String {
    let Some((_, list)) = error.split_once("unknown field ") else {
        return String::new();
    };
    // Names stand between signs like these.
    let mut names = list.split('`').skip(1).step_by(2);
    names
        .next()
        .map_or_else(String::new, |typed| nearest(typed, names))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn misspelt_names_are_recognised() {
        let names = ["graphene", "hBN", "MoS2", "WSe2"];
        let of = |typed: &str| nearest(typed, names.into_iter());
        assert_eq!(of("grapheme"), "; did you mean \"graphene\"?");
        assert_eq!(of("Mos 2"), "; did you mean \"MoS2\"?");
        assert_eq!(of("unobtainium"), "");
    }

    #[test]
    fn misspelt_keys_are_recognised() {
        let words = "unknown field `metod`, expected one of `channel`, `method`, `seed`";
        assert_eq!(nearest_key(words), "; did you mean \"method\"?");
        assert_eq!(nearest_key("expected a number"), "");
    }
}
