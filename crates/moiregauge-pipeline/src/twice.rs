//! Files that were named more than once.

use std::collections::HashMap;
use std::path::PathBuf;

/// A path that leads to a file that another one has named already.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Repeated {
    /// The path as the user gave it.
    pub path: PathBuf,
    /// The first path of the same file; it may be spelt alike.
    pub of: PathBuf,
}

/// Each file once, in the order in which they were named first, and the names that lead to a file again: however they
/// are spelt, and through links.
pub fn distinct(paths: &[PathBuf]) -> (Vec<PathBuf>, Vec<Repeated>) {
    let (mut files, mut repeated) = (Vec::new(), Vec::new());
    let mut known: HashMap<PathBuf, PathBuf> = HashMap::new();
    for path in paths {
        // What cannot be found is known by its name; reading it says why.
        let real = path.canonicalize().unwrap_or_else(|_| path.clone());
        if let Some(of) = known.get(&real) {
            repeated.push(Repeated {
                path: path.clone(),
                of: of.clone(),
            });
        } else {
            known.insert(real, path.clone());
            files.push(path.clone());
        }
    }
    (files, repeated)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_of_several_names_is_one() {
        let folder = tempfile::tempdir().unwrap();
        let (a, b) = (folder.path().join("a.spm"), folder.path().join("b.spm"));
        std::fs::write(&a, "1").unwrap();
        std::fs::write(&b, "1").unwrap();
        let other = folder.path().join(".").join("a.spm");
        let missing = folder.path().join("c.spm");
        let mut names = vec![
            b.clone(),
            a.clone(),
            other.clone(),
            missing.clone(),
            a.clone(),
        ];
        #[cfg(unix)]
        {
            let link = folder.path().join("link");
            std::os::unix::fs::symlink(&b, &link).unwrap();
            names.push(link);
        }
        let (files, repeated) = distinct(&names);
        // Equal bytes make no equal file: that is for those who read them.
        assert_eq!(files, [b.clone(), a.clone(), missing]);
        let of: Vec<_> = repeated.iter().map(|r| (&r.path, &r.of)).collect();
        assert_eq!(of[..2], [(&other, &a), (&a, &a)]);
        assert!(of[2..].iter().all(|(_, of)| **of == b));
        assert_eq!(of.len(), names.len() - 3);
    }
}
