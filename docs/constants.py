#!/usr/bin/env python3
"""What docs/constants.sh needs beside a compiler.

  constants.py prepare CRATES LIST  makes the listed constants of a COPY of the crates readable from the environment
  constants.py compare OLD NEW      one line: what differs between two outputs of the example `constants`

A line of LIST is `place NAME scenes half double`. The place is some names of folders and of the file, in order, that single
out one file with that constant: a file may move. MOIREGAUGE_VARIED='place::NAME how' then changes one of them in a run, with
how: half, double, closer (half as far from 1), root (of it), or a number.
"""

import math
import re
import sys
from collections import Counter
from pathlib import Path

VARIED = """//! One constant, changed by the environment.

pub(crate) trait Varied: Copy {
    fn by(self, how: &str) -> Self;
}

impl Varied for f64 {
    fn by(self, how: &str) -> Self {
        match how {
            "half" => self / 2.0,
            "double" => self * 2.0,
            "closer" => 1.0 - (1.0 - self) / 2.0,
            "root" => self.sqrt(),
            number => number.parse().expect("a number"),
        }
    }
}

macro_rules! whole {
    ($($t:ty),*) => { $(impl Varied for $t {
        fn by(self, how: &str) -> Self { (self as f64).by(how).round() as $t }
    })* };
}
whole!(i32, i64, usize);

impl<T: Varied, const N: usize> Varied for [T; N] {
    fn by(self, how: &str) -> Self { self.map(|x| x.by(how)) }
}

pub(crate) fn varied<T: Varied>(name: &str, value: T) -> T {
    let wanted = std::env::var("MOIREGAUGE_VARIED").unwrap_or_default();
    match wanted.split_once(' ') {
        Some((which, how)) if which == name => {
            eprintln!("reached");
            value.by(how)
        }
        _ => value,
    }
}
"""


CRATES = ["moiregauge", "heterostrain"]


def files(crates, place, name):
    """Files of the core that have the constant, with the names of `place` in their paths in order: the least deep of them."""
    wanted = place.split("/")
    found = []
    for source, file in [(s, f) for s in (crates / c / "src" for c in CRATES) for f in sorted(s.rglob("*.rs"))]:
        parts = list(file.relative_to(source).with_suffix("").parts)
        if parts[-1] == "mod" and len(parts) > 1:
            parts.pop()
        rest = iter(parts)
        if parts[-1] == wanted[-1] and all(part in rest for part in wanted):
            if re.search(definition(name), file.read_text(), re.M):
                found.append((len(parts), file))
    return [file for depth, file in found if depth == min(found)[0]]


def definition(name):
    return rf"^([ \t]*)((?:pub(?:\([a-z ]*\))? )?)const {name}: ([^=]+?) =\s*([^;]+(?:; \d+\])?[^;]*);"


def prepare(crates, lines):
    # What is looked at in two kinds of scenes stands there twice.
    for place, name in dict.fromkeys((place, name) for place, name, *_ in lines):
        found = files(crates, place, name)
        if len(found) != 1:
            sys.exit(f"{place} {name}: expected one file, found {[str(f) for f in found]}")
        text = found[0].read_text()

        def call(match):
            margin, public, kind, value = match.groups()
            return (
                f"{margin}#[allow(non_snake_case)]\n{margin}{public}fn {name}() -> {kind} {{\n"
                f"static VALUE: std::sync::OnceLock<{kind}> = std::sync::OnceLock::new();\n"
                f'*VALUE.get_or_init(|| crate::varied::varied("{place}::{name}", {value}))\n}}'
            )

        head = re.search(definition(name), text, re.M)
        # Words quote the value as it stands.
        quoted = re.compile(rf"\{{{name}(?::[^}}]*)?\}}")
        text = quoted.sub(head.group(4), text)
        head = re.search(definition(name), text, re.M)
        before, after = text[: head.start()], text[head.end() :]
        use = re.compile(rf"(?<![:\w`\"]){name}\b(?!\()(?!`)")

        def used(part):
            code = (line.split("//", 1) for line in part.split("\n"))
            return "\n".join("//".join([use.sub(f"{name}()", c[0]), *c[1:]]) for c in code)

        found[0].write_text(used(before) + call(head) + used(after))
        # Files that import it call it as well.
        module = found[0].parent.name if found[0].stem == "mod" else found[0].stem
        imported = re.compile(rf"^(?:pub\(crate\) )?use crate::[\w:]*\b{module}::(?:\{{[^}}]*\b{name}\b[^}}]*\}}|{name});\n", re.M)
        for crate in CRATES:
            for file in sorted((crates / crate / "src").rglob("*.rs")):
                text = quoted.sub(head.group(4), file.read_text())
                import_of = imported.search(text)
                if file != found[0] and import_of:
                    file.write_text(used(text[: import_of.start()]) + import_of.group() + used(text[import_of.end() :]))
    for crate in CRATES:
        (crates / crate / "src/varied.rs").write_text(VARIED)
        root = crates / crate / "src/lib.rs"
        root.write_text(root.read_text() + "\nmod varied;\n")


def read(file):
    """Scene → what is said, how often, and the numbers by their names."""
    scenes = {}
    for line in Path(file).read_text().splitlines():
        place, what, *rest = (part.strip() for part in line.split(" | "))
        scene = re.split(r", (?:set \d|all$|moiré \d)", place)[0]
        said, numbers = scenes.setdefault(scene, (Counter(), {}))
        if what == "said":
            words = re.sub(r" \(.*|: trace.*|: retrace.*", "", " ".join(rest))
            words = re.sub(r"frame \d+ refused", "frame refused", words)
            words = re.sub(r"^(no [a-z ]+):.*", r"\1", words)
            if not words.endswith(": false") or words.startswith(("Phases", "Domains")):
                said[words.removesuffix(": true")] += 1
        else:
            value, sigma = [*" ".join(rest).replace("|", " ").split(), "nan"][:2]
            number = sum(1 for known in numbers if known[:2] == (place, what))
            numbers[place, what, number] = (float(value), float(sigma))
    return scenes


# What is said beside results that is no doubt.
FLAGS = {"phases linked", "acceleration", "settling", "fast gain", "corrected", "joint", "axis"}


def is_result(what):
    """Numbers with an error that are handed on: not those of single frames, nor spreads."""
    return not re.search(r"^frame|spread", what)


def compare(old, new):
    old, new = read(old), read(new)
    for scene in [scene for scene in new if scene not in old]:
        if "no scene comes to it" in new[scene][0]:
            return print("no scene comes to it")
    changed, come, gone, silent, counts = [], Counter(), Counter(), [], {}
    largest, factors, amount = (0.0, ""), [1.0, 1.0], 0
    for scene, (said, numbers) in old.items():
        said_now, now = new.get(scene, (Counter({"it stopped": 1}), {}))
        come.update((said_now - said).keys())
        gone.update((said - said_now).keys())
        moved, differs = 0.0, said != said_now or numbers.keys() != now.keys()
        amount += len(now) - len(numbers)
        for key, (value, sigma) in numbers.items():
            value_now, sigma_now = now.get(key, (math.nan, math.nan))
            same = abs(value - value_now) <= 1e-6 * abs(value) or math.isnan(value) and math.isnan(value_now)
            known = sigma > 0.0 and sigma_now > 0.0
            if same and (not known or abs(sigma_now / sigma - 1.0) < 1e-6):
                continue
            differs = True
            if known and is_result(key[1]):
                moved = max(moved, abs(value - value_now) / max(sigma, sigma_now))
                largest = max(largest, (abs(value - value_now) / sigma, scene))
                factors = [min(factors[0], sigma_now / sigma), max(factors[1], sigma_now / sigma)]
            elif math.isnan(sigma) and key[1].startswith(("nodes", "names", "readings", "cells")) and not math.isnan(value_now):
                counts.setdefault(key[1], []).append(f"{value:g} → {value_now:g}")
        if differs:
            changed.append(scene)
        if moved > 5.0 and not set(said_now - said) - FLAGS:
            silent.append(scene)
    if not changed:
        return print("no result changes")
    short = lambda scene: re.sub(r"^[a-z ]+: (recorded, )?", "", scene)
    parts = [f"{len(changed)} of {len(old)} scenes" + (f" ({', '.join(map(short, changed))})" if len(changed) < 4 else "")]
    where = f" ({short(largest[1])})" if len(changed) > 1 else ""
    parts.append(f"{largest[0]:.2g} σ{where}" if largest[0] >= 0.01 else "less than 0.01 σ")
    if max(factors[1], 1.0 / factors[0]) > 1.05:
        parts.append("σ × " + " to ".join(f"{f:.2g}" for f in factors if abs(f - 1.0) > 0.05))
    times = lambda count: f" ({count})" if count > 1 else ""
    parts += [f"+ {words}{times(count)}" for words, count in come.most_common(4)]
    parts += [f"− {words}{times(count)}" for words, count in gone.most_common(4)]
    parts += [f"{what}: {all[0]}" for what, all in list(counts.items())[:2]]
    if amount and not come - Counter(FLAGS) and not gone - Counter(FLAGS):
        parts.append(f"{abs(amount)} numbers {'more' if amount > 0 else 'fewer'}")
    if silent:
        parts.append(f"by more than 5 σ without a word: {', '.join(map(short, silent))}")
    print("; ".join(parts))


if __name__ == "__main__":
    if sys.argv[1] == "prepare":
        listed = Path(sys.argv[3]).read_text().splitlines()
        prepare(Path(sys.argv[2]), [line.split() for line in listed if line.strip()])
    else:
        compare(sys.argv[2], sys.argv[3])
