//! Writing results, never over older ones without leave.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, ensure};

/// An error if the folder holds the results of an earlier analysis.
pub(super) fn refuse_overwriting(out: &Path, force: bool) -> anyhow::Result<()> {
    ensure!(
        !out.exists() || out.is_dir(),
        "--out {} is a file; a folder is expected",
        out.display()
    );
    ensure!(
        force
            || !["", "moire-1"]
                .iter()
                .any(|of| out.join(of).join("results.json").exists()),
        "{} already holds results; give another --out, or --force to write over them",
        out.display()
    );
    Ok(())
}

/// Where the results of each of `moires` moirés go.
pub(super) fn folders(out: &Path, moires: usize) -> Vec<PathBuf> {
    if moires == 1 {
        return vec![out.to_owned()];
    }
    (1..=moires)
        .map(|n| out.join(format!("moire-{n}")))
        .collect()
}

/// Writes named files into a folder.
pub(crate) fn write_all(out: &Path, files: &[(String, Vec<u8>)]) -> anyhow::Result<()> {
    for (name, bytes) in files {
        let path = out.join(name);
        let folder = path.parent().unwrap_or(out);
        std::fs::create_dir_all(folder)
            .with_context(|| format!("cannot make the folder {}", folder.display()))?;
        std::fs::write(&path, bytes).with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(())
}

/// The file to open first.
pub(super) fn main_file(out: &Path, files: &[(String, Vec<u8>)]) -> PathBuf {
    let report = files.iter().any(|(name, _)| name == "report.html");
    out.join(if report {
        "report.html"
    } else {
        "results.json"
    })
}
